//! The compact descriptor: how visible the noise is where it is most visible, and how much texture there is to hide it.
//!
//! Noise mask energies of the residual, at four scales, are taken on blocks of 8×8 pixels. Texture of the picture masks them,
//! brightness brings them out; pooling with a high exponent follows the observers, who look for the worst place. Beside this
//! one number that falls with the samples stand two that say what the tile is made of.
//!
//! The same three of the whole picture stand beside them, since people judge a tile in its picture: between the zones of one
//! picture, thresholds vary less than in proportion to noise energy (in six of eight scenes as its power of 0.26 to 0.65). Constants were chosen by
//! leaving scenes out, on the human data; `docs/accuracy.md` has the scores of each choice.

use super::Described;
use crate::evidence::{APRON, ROUNDING_LUMINANCE, TilePlanes};
use crate::mask::NoiseMask;
use ndarray::Array2;
use std::cell::RefCell;

/// What the numbers are.
pub(super) const NAMES: [&str; 6] = [
    "visible_noise",
    "textured_area",
    "texture_energy",
    "picture_noise",
    "picture_textured_area",
    "picture_texture_energy",
];
/// Those of the tile by itself; the others are the picture's.
pub(super) const OWN: usize = 3;
/// Which of them are noise, the tile's and the picture's.
const NOISE: [usize; 2] = [0, OWN];
/// Which of the tile's own are texture, and stay as they are when noise falls.
pub(super) const TEXTURE: [usize; 2] = [1, 2];

/// All numbers are logarithms of amplitudes, and differ by 0.4 to 0.8 over the human data. Where scenes are few and alike, the
/// picture's numbers hardly differ, and a machine would make much of it.
pub(super) const LEAST_DEVIATION: f64 = 0.3;

/// Edge of a block at full resolution, in pixels; the apron is one block.
const BLOCK: usize = APRON;
/// Weight of the noise of each scale, full resolution first: people see coarse noise better.
const SCALES: [f32; 4] = [1.0, 1.6, 5.3, 5.0];
/// Times the noise that is taken off the mask energy of the picture: what remains is texture for certain.
const CERTAIN: f32 = 2.0;
/// Texture energy, in squared 8-bit steps, from which masking sets in; energies fall as 1/√(1 + texture/knee).
const MASKING_KNEE: f32 = 100.0;
/// Noise energies count (Y′ + offset)^exponent.
const BRIGHTNESS_OFFSET: f32 = 0.05;
const BRIGHTNESS_EXPONENT: f32 = 0.6;
/// Pooling exponent over the blocks of a tile, on amplitudes.
const POOLING: i32 = 12;
/// Floors in squared 8-bit steps, under logarithms.
const NOISE_FLOOR: f32 = 1e-3;
const TEXTURE_FLOOR: f32 = 4.0;
/// Energies are in squared steps of 8-bit display values.
const STEP: f32 = 1.0 / 255.0;

/// What the numbers are pooled from, on the grid of 8×8-pixel blocks, row-major, energies in squared 8-bit steps; and room for what
/// they are made from. Each thread keeps its own, so that a verdict allocates nothing.
#[derive(Default)]
struct Blocks {
    visible: Vec<f32>,
    texture: Vec<f32>,
    noise: [Vec<f32>; SCALES.len()],
    picture: [Vec<f32>; SCALES.len()],
    brightness: Vec<f32>,
    room: Room,
}

thread_local! {
    static BLOCKS: RefCell<Blocks> = RefCell::default();
}

impl Blocks {
    /// What `use_them` makes of those of a tile.
    fn with<T>(planes: &TilePlanes, mask: NoiseMask, use_them: impl FnOnce(&Self) -> T) -> T {
        BLOCKS.with_borrow_mut(|blocks| {
            blocks.fill(planes, mask);
            use_them(blocks)
        })
    }

    fn fill(&mut self, planes: &TilePlanes, mask: NoiseMask) {
        let Self { visible, texture, noise, picture, brightness, room } = self;
        let (width, residual) = level(&planes.residual);
        let (_, image) = level(&planes.image);
        // Mask energies on blocks: noise, and the picture itself.
        energies(width, residual, mask, planes.rounding * ROUNDING_LUMINANCE, noise, room);
        energies(width, image, mask, 0.0, picture, room);
        let rows = image.len() / width;
        block_means([width, rows], BLOCK, &mut room.sums, brightness, |y, sums| {
            let row = &image[y * width..(y + 1) * width];
            sums.iter_mut().zip(row).for_each(|(sum, &value)| *sum += value);
        });

        // Texture is what the picture has more than noise; it masks noise of its own scale.
        for sums in [&mut *visible, &mut *texture] {
            sums.clear();
            sums.resize(brightness.len(), 0.0);
        }
        for ((weight, noise), picture) in SCALES.iter().zip(noise).zip(picture) {
            for (at, (&mut noise, &mut picture)) in noise.iter_mut().zip(picture).enumerate() {
                let masking = (picture - CERTAIN * noise).max(0.0);
                visible[at] += weight * noise / (1.0 + masking / MASKING_KNEE).sqrt();
                texture[at] += masking;
            }
        }
        for (visible, luma) in visible.iter_mut().zip(brightness) {
            *visible *= (luma.max(0.0) + BRIGHTNESS_OFFSET).powf(BRIGHTNESS_EXPONENT);
        }
    }
}

/// The tile's own numbers.
pub(super) fn describe(planes: &TilePlanes, mask: NoiseMask) -> [f32; OWN] {
    Blocks::with(planes, mask, pool)
}

/// Pools over the blocks. Sums run over ratios to the largest energy, so that no power overflows.
fn pool(Blocks { visible, texture, .. }: &Blocks) -> [f32; OWN] {
    let blocks = visible.len() as f32;
    let largest = visible.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    let pooled = visible.iter().map(|v| (v / largest).powi(POOLING / 2)).sum::<f32>() / blocks;
    let energy = largest * pooled.powf(2.0 / POOLING as f32);
    let log_amplitude = |energy: f32| 0.5 * energy.ln();
    [
        log_amplitude(energy + NOISE_FLOOR),
        texture.iter().map(|t| log_amplitude(t + TEXTURE_FLOOR)).sum::<f32>() / blocks,
        log_amplitude(texture.iter().sum::<f32>() / blocks + TEXTURE_FLOOR),
    ]
}

/// The amplitude of visible noise at each pixel of the tile, that of its block, in 8-bit steps. Its mean of order [`POOLING`] over
/// the blocks is what the first number is the logarithm of.
pub(super) fn visible_noise(planes: &TilePlanes, mask: NoiseMask) -> Array2<f32> {
    let (height, width) = (planes.inner.height, planes.inner.width);
    Blocks::with(planes, mask, |Blocks { visible, .. }| {
        let columns = width.div_ceil(BLOCK);
        Array2::from_shape_fn((height, width), |(y, x)| visible[y / BLOCK * columns + x / BLOCK].sqrt())
    })
}

/// The amplitude behind the first number, in 8-bit steps.
pub(super) fn pooled_amplitude(descriptor: &[f32]) -> f32 {
    noise_energy(descriptor[0]).sqrt() as f32
}

/// Noise energy above the floor, of a noise number.
fn noise_energy(number: f32) -> f64 {
    f64::from(((2.0 * number).exp() - NOISE_FLOOR).max(0.0))
}

fn noise_number(energy: f64) -> f32 {
    (0.5 * (energy + f64::from(NOISE_FLOOR)).ln()) as f32
}

/// Appends to each tile's own numbers those of the picture that the tiles make up: root mean square of their visible noise, and
/// means of their texture numbers, by area. Noise is what the tile at hand has with its own samples and the picture would have
/// with as many: energies are taken to one sample, averaged, and brought to the tile's samples.
pub(super) fn in_picture(tiles: &[Described]) -> Vec<Vec<f32>> {
    let area: f64 = tiles.iter().map(|t| t.area).sum();
    let mean =
        |quantity: &dyn Fn(&Described) -> f64| tiles.iter().map(|t| t.area * quantity(t)).sum::<f64>() / area;
    let of_one_sample = mean(&|t| noise_energy(t.own[0]) * t.samples);
    let texture = [1, 2].map(|i| mean(&|t| f64::from(t.own[i])) as f32);
    let complete = |tile: &Described| {
        let picture = [noise_number(of_one_sample / tile.samples), texture[0], texture[1]];
        tile.own.iter().copied().chain(picture).collect()
    };
    tiles.iter().map(complete).collect()
}

/// Noise energy goes as 1/n, the picture's as the tile's; texture stays.
pub(super) fn project(descriptor: &mut [f32], factor: f32) {
    for i in NOISE {
        descriptor[i] = noise_number(noise_energy(descriptor[i]) / f64::from(factor));
    }
}

/// Room for the rows and levels on the way to energies on blocks.
#[derive(Default)]
struct Room {
    levels: [Vec<f32>; SCALES.len() - 1],
    column: Vec<f32>,
    row: Vec<f32>,
    sums: Vec<f32>,
    rough: Vec<f32>,
}

/// The width of a plane, and its pixels, row-major.
fn level(plane: &Array2<f32>) -> (usize, &[f32]) {
    (plane.ncols(), plane.as_slice().expect("planes are in standard layout"))
}

/// Mask energies of a plane with apron at full, half, quarter and eighth resolution, each on the grid of 8×8-pixel blocks, in
/// squared 8-bit steps; `rounding` is the known variance of white rounding noise in the plane, which is taken off.
fn energies(
    width: usize,
    plane: &[f32],
    mask: NoiseMask,
    rounding: f32,
    out: &mut [Vec<f32>; SCALES.len()],
    room: &mut Room,
) {
    let Room { levels, column, row, sums, rough } = room;
    let [half, quarter, eighth] = levels;
    halve(width, plane, half);
    halve(width / 2, half, quarter);
    halve(width / 4, quarter, eighth);
    column.resize(width, 0.0);
    row.resize(width, 0.0);
    for (scale, (level, out)) in [plane, half, quarter, eighth].into_iter().zip(out).enumerate() {
        let (width, edge) = (width >> scale, BLOCK >> scale);
        let row = &mut row[..width];
        block_means([width, level.len() / width], edge, sums, rough, |y, sums| {
            // The apron is not summed: there are rows above and below
            let around = [y - 1, y, y + 1].map(|y| &level[y * width..(y + 1) * width]);
            mask.apply_to_row(around, column, row);
            sums.iter_mut().zip(&*row).for_each(|(sum, &value)| *sum += value * value);
        });
        let known = mask.white_noise_gain() * rounding / (1 << (2 * scale)) as f32;
        rough.iter_mut().for_each(|e| *e = (*e - known).max(0.0) / (STEP * STEP));
        smooth(width / edge - 2, rough, out);
    }
}

/// Means of 2×2 pixels.
fn halve(width: usize, plane: &[f32], out: &mut Vec<f32>) {
    out.clear();
    for rows in plane.chunks_exact(2 * width) {
        let (above, below) = rows.split_at(width);
        let pairs = above.as_chunks().0.iter().zip(below.as_chunks().0);
        out.extend(pairs.map(|([a, b], [c, d])| 0.25 * (a + b + c + d)));
    }
}

/// Means over blocks of `edge`×`edge` pixels of a plane of [width, height], without the apron, which is one block wide; `add(y, sums)`
/// adds row `y` to sums along columns.
fn block_means(
    [width, height]: [usize; 2],
    edge: usize,
    sums: &mut Vec<f32>,
    out: &mut Vec<f32>,
    mut add: impl FnMut(usize, &mut [f32]),
) {
    out.clear();
    for block in 1..height / edge - 1 {
        sums.clear();
        sums.resize(width, 0.0);
        (block * edge..(block + 1) * edge).for_each(|y| add(y, sums));
        let blocks = sums.chunks_exact(edge).skip(1).take(width / edge - 2);
        out.extend(blocks.map(|block| block.iter().sum::<f32>() / (edge * edge) as f32));
    }
}

/// Binomial smoothing 1-2-1 over the grid of blocks, both ways; the edge repeats.
fn smooth(columns: usize, blocks: &[f32], out: &mut Vec<f32>) {
    let rows = blocks.len() / columns;
    let along = |before: f32, here: f32, after: f32| 0.25 * (before + 2.0 * here + after);
    out.clear();
    for y in 0..rows {
        let [above, here, below] = [y.saturating_sub(1), y, (y + 1).min(rows - 1)].map(|y| y * columns);
        let down = |x: usize| along(blocks[above + x], blocks[here + x], blocks[below + x]);
        out.extend(
            (0..columns).map(|x| along(down(x.saturating_sub(1)), down(x), down((x + 1).min(columns - 1)))),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tile::Tile;
    use proptest::prelude::*;

    /// A seeded tile of 64×64 pixels with its apron: a ramp with a checker on it, and noise, four times as strong in one corner.
    #[derive(Clone, Copy)]
    struct Recipe {
        seed: u64,
        base: f64,
        ramp: (f64, f64),
        checker: (f64, usize),
        noise: f64,
    }

    fn tile(Recipe { seed, base, ramp, checker, noise }: Recipe) -> TilePlanes {
        let mut state = seed;
        let mut bell = || {
            let mut uniform = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 40) as f64 / f64::from(1 << 24)
            };
            uniform() + uniform() + uniform() + uniform() - 2.0
        };
        let mut planes = [(); 2].map(|()| Array2::<f32>::zeros((80, 80)));
        for y in 0..80 {
            for x in 0..80 {
                // The last two were colours once: the reference implementation still draws them.
                let [in_picture, held_against, ..] = [bell(), bell(), bell(), bell()];
                let check = if (x / checker.1 + y / checker.1) % 2 == 1 { checker.0 } else { 0.0 };
                let clean = base + ramp.0 * (x as f64 / 80.0) + ramp.1 * (y as f64 / 80.0) + check;
                let amplitude = noise * if x >= 56 && y < 24 { 4.0 } else { 1.0 };
                let values = [clean + amplitude * in_picture, amplitude * held_against];
                for (plane, value) in planes.iter_mut().zip(values) {
                    plane[(y, x)] = value as f32;
                }
            }
        }
        let [image, residual] = planes;
        let inner = Tile { index: 0, x: 8, y: 8, width: 64, height: 64 };
        TilePlanes { image, residual, rounding: 0.0, inner }
    }

    fn describe_tile(planes: &TilePlanes) -> Vec<f32> {
        describe(planes, NoiseMask::default()).to_vec()
    }

    fn energies_of(plane: &Array2<f32>, mask: NoiseMask) -> [Vec<f32>; 4] {
        let mut out = Default::default();
        let (width, plane) = level(plane);
        energies(width, plane, mask, 0.0, &mut out, &mut Room::default());
        out
    }

    fn mean(values: &[f32]) -> f32 {
        values.iter().sum::<f32>() / values.len() as f32
    }

    /// Answers of an independent implementation in numpy, in f64.
    #[test]
    fn equals_the_reference_implementation() {
        let recipe = |seed, base, ramp, checker, noise| Recipe { seed, base, ramp, checker, noise };
        let known = [
            (recipe(1, 0.5, (0.0, 0.0), (0.0, 4), 0.01), [1.333_644_7, 0.693_892_4, 0.693_896_3]),
            (recipe(2, 0.3, (0.4, 0.1), (0.1, 5), 0.02), [2.226_884, 2.382_053_1, 2.387_952]),
            (recipe(3, 0.05, (0.02, 0.0), (0.0, 8), 0.002), [-0.753_620_5, 0.693_198, 0.693_198_1]),
            (recipe(4, 0.8, (0.1, -0.2), (0.03, 2), 0.005), [0.884_517_3, 1.639_809_9, 1.640_686_4]),
            (recipe(5, 0.6, (0.0, 0.0), (0.02, 16), 0.0), [-3.453_877_6, 1.225_777_6, 1.225_777_6]),
        ];
        for (recipe, expected) in known {
            let got = describe_tile(&tile(recipe));
            for (g, e) in got.iter().zip(expected) {
                assert!((g - e).abs() < 1e-4, "seed {}: {got:?} against {expected:?}", recipe.seed);
            }
        }
    }

    /// White noise of variance σ² has σ²/4ˢ left after s halvings, of which the mask lets its gain through.
    #[test]
    fn white_noise_has_the_energy_it_should() {
        let mut planes =
            tile(Recipe { seed: 7, base: 0.5, ramp: (0.0, 0.0), checker: (0.0, 4), noise: 0.01 });
        planes.residual.indexed_iter_mut().for_each(|((y, x), v)| {
            if x >= 56 && y < 24 {
                *v /= 4.0;
            }
        });
        let mask = NoiseMask::default();
        let variance = 0.01 * 0.01 * 4.0 / 12.0 / (STEP * STEP);
        for (scale, energy) in energies_of(&planes.residual, mask).iter().enumerate() {
            let expected = variance * mask.white_noise_gain() / (1 << (2 * scale)) as f32;
            // 4096/4ˢ pixels, neighbours correlated by the mask: a standard error below 2.5 %·2ˢ; 4 σ.
            let tolerance = 0.1 * (1 << scale) as f32;
            assert!((mean(energy) / expected - 1.0).abs() < tolerance, "scale {scale}");
        }
    }

    /// White noise of known σ on flat grey: a mask energy of σ²·gain/4ˢ at each scale s, weighted by scale and brightness.
    #[test]
    fn the_map_shows_white_noise_as_strong_as_it_is() {
        let mut planes =
            tile(Recipe { seed: 7, base: 0.5, ramp: (0.0, 0.0), checker: (0.0, 4), noise: 0.01 });
        // Noise of one strength everywhere, and a picture without any, so that nothing passes for texture.
        let corner =
            |((y, x), v): ((usize, usize), &mut f32)| *v /= if x >= 56 && y < 24 { 4.0 } else { 1.0 };
        planes.residual.indexed_iter_mut().for_each(corner);
        planes.image.fill(0.5);
        let mask = NoiseMask::default();
        let map = visible_noise(&planes, mask);
        assert_eq!(map.dim(), (64, 64));

        let variance = 0.01 * 0.01 * 4.0 / 12.0 / (STEP * STEP);
        let scales: f32 = SCALES.iter().enumerate().map(|(s, w)| w / (1 << (2 * s)) as f32).sum();
        let brightness = (0.5 + BRIGHTNESS_OFFSET).powf(BRIGHTNESS_EXPONENT);
        let expected = variance * mask.white_noise_gain() * scales * brightness;
        // Half of the energy is in the first scale (standard error 2.5 %), a quarter, a fifth and a twentieth in the others
        // (5, 10, 20 %), as in `white_noise_has_the_energy_it_should`: 3 % in all; 4 σ.
        let energy = map.mapv(|v| v * v).mean().unwrap();
        assert!((energy / expected - 1.0).abs() < 0.12, "{energy} against {expected}");
    }

    #[test]
    fn the_first_number_is_pooled_from_the_map() {
        for seed in 1..5 {
            let recipe = Recipe { seed, base: 0.3, ramp: (0.4, 0.1), checker: (0.1, 5), noise: 0.02 };
            let planes = tile(recipe);
            let map = visible_noise(&planes, NoiseMask::default()).mapv(f64::from);
            let mean = map.mapv(|v| v.powi(POOLING)).mean().unwrap().powf(1.0 / f64::from(POOLING));
            let descriptor = describe_tile(&planes);
            let number = 0.5 * (mean * mean + f64::from(NOISE_FLOOR)).ln();
            assert!(
                (f64::from(descriptor[0]) - number).abs() < 1e-4,
                "seed {seed}: {descriptor:?}, {number}"
            );
            assert!((f64::from(pooled_amplitude(&descriptor)) / mean - 1.0).abs() < 1e-4, "seed {seed}");
        }
    }

    /// The difference of two pictures whose R′, G′ and B′ were rounded to 8 bits has the energy that is known.
    #[test]
    fn rounding_has_the_energy_it_should() {
        let mut planes = tile(Recipe { seed: 7, base: 0.5, ramp: (0.0, 0.0), checker: (0.0, 4), noise: 0.0 });
        let mut state = 3u64;
        let mut rounded = || {
            let mut uniform = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 40) as f32 / (1 << 24) as f32
            };
            STEP * (uniform() - uniform())
        };
        for at in ndarray::indices((80, 80)) {
            let rgb = [rounded(), rounded(), rounded()];
            planes.residual[at] = crate::luminance(rgb);
        }
        let mask = NoiseMask::default();
        // In squared steps: two roundings, 1/12 each.
        let known = mask.white_noise_gain() * ROUNDING_LUMINANCE * 2.0 / 12.0;
        let [energy, ..] = energies_of(&planes.residual, mask);
        // 4096 pixels: a standard error below 3 %; 4 σ.
        assert!((mean(&energy) / known - 1.0).abs() < 0.12, "{energy:?} against {known}");
    }

    fn described(own: [f32; OWN], samples: f64, area: f64) -> Described {
        Described { own: own.to_vec(), samples, area }
    }

    /// Two tiles, the second with three times the area and a quarter of the samples: at as many samples, energies average.
    #[test]
    fn the_picture_is_the_mean_of_its_tiles_at_the_samples_of_each() {
        let amplitude = |a: f32| 0.5 * (a * a + NOISE_FLOOR).ln();
        let tiles = [
            described([amplitude(1.0), 1.0, 2.0], 400.0, 1.0),
            described([amplitude(4.0), 3.0, 6.0], 100.0, 3.0),
        ];
        let [first, second] = in_picture(&tiles).try_into().unwrap();
        // At 400 samples the second has an energy of 16/4: (1 + 3·4)/4.
        let expected = [tiles[0].own[0], 1.0, 2.0, amplitude(3.25f32.sqrt()), 2.5, 5.0];
        assert!(first.iter().zip(expected).all(|(g, e)| (g - e).abs() < 1e-5), "{first:?}");
        // At 100 samples all noise has four times the energy.
        assert!((second[3] - amplitude(13f32.sqrt())).abs() < 1e-5, "{second:?}");
        assert_eq!(first.len(), NAMES.len());
    }

    #[test]
    fn a_tile_alone_is_its_own_picture() {
        for own in [[1.0, 2.0, 3.0], [-3.4, 0.7, 0.7]] {
            let [all] = in_picture(&[described(own, 123.0, 64.0)]).try_into().unwrap();
            assert!(all[..OWN].iter().zip(&all[OWN..]).all(|(own, picture)| (own - picture).abs() < 1e-4));
        }
    }

    proptest! {
        #[test]
        fn projection_is_what_more_samples_do(seed in 0u64..1000, noise in 0.001f64..0.05, factor in 1.0f32..100.0) {
            // On a flat picture, where noise leaves nothing that passes for texture.
            let recipe = Recipe { seed, base: 0.5, ramp: (0.0, 0.0), checker: (0.0, 4), noise };
            let mut planes = tile(recipe);
            planes.image.fill(0.5);
            let whole = |planes: &TilePlanes, samples: f32| {
                let own = describe_tile(planes).try_into().unwrap();
                in_picture(&[described(own, f64::from(samples), 1.0)]).remove(0)
            };
            let mut projected = whole(&planes, 10.0);
            project(&mut projected, factor);
            planes.residual.mapv_inplace(|v| v / factor.sqrt());
            let real = whole(&planes, 10.0 * factor);
            prop_assert!(TEXTURE.iter().all(|&i| real[i] == projected[i]));
            prop_assert!(real.iter().zip(&projected).all(|(r, p)| (r - p).abs() < 1e-3), "{real:?} {projected:?}");
        }

        #[test]
        fn is_finite_on_extreme_planes(image in -1e3f32..1e3, residual in -1e6f32..1e6) {
            let mut planes = tile(Recipe { seed: 1, base: 0.5, ramp: (0.0, 0.0), checker: (0.0, 4), noise: 0.01 });
            planes.image.fill(image);
            planes.residual.mapv_inplace(|v| v * residual);
            prop_assert!(describe_tile(&planes).iter().all(|v| v.is_finite()));
        }
    }
}
