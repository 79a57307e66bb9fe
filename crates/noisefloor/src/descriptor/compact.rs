//! The compact descriptor: how visible the noise is where it is most visible, and how much texture there is
//! to hide it.
//!
//! Noise mask energies of the residual, at four scales, are taken on blocks of 8×8 pixels. Texture of the
//! picture masks them, brightness brings them out; pooling with a high exponent follows the observers, who
//! look for the worst place. Beside this one number that falls with the samples stand two that say what the
//! tile is made of.
//!
//! The same three of the whole picture stand beside them, since people judge a tile in its picture: between
//! the zones of one picture, thresholds vary less than in proportion to noise energy (in six of eight scenes
//! as its power of 0.26 to 0.65). Constants were chosen by leaving scenes out, on the human data;
//! `docs/accuracy.md` has the scores of each choice.

use super::kind::{Described, Descriptor, DescriptorError, DescriptorKind, TileDescriptor, mask};
use crate::descriptor::NoiseMask;
use crate::{
    display::ROUNDING_LUMINANCE,
    evidence::{HALO, TilePlanes},
};
use ndarray::Array2;
use std::cell::RefCell;
use std::collections::BTreeMap;

/// What the numbers are.
const NAMES: [&str; 6] = [
    "visible_noise",
    "textured_area",
    "texture_energy",
    "picture_noise",
    "picture_textured_area",
    "picture_texture_energy",
];
/// Those of the tile by itself; the others are the picture's.
const OWN: usize = 3;
/// Which of them are noise, the tile's and the picture's.
const NOISE: [usize; 2] = [0, OWN];
/// Which of the tile's own are texture, and stay as they are when noise falls.
const TEXTURE: [usize; 2] = [1, 2];

/// All numbers are logarithms of amplitudes, and differ by 0.4 to 0.8 over the human data. Where scenes are
/// few and alike, the picture's numbers hardly differ, and a machine would make much of it.
const LEAST_DEVIATION: f64 = 0.3;

/// Edge of a block at full resolution, in pixels; the halo is one block.
const BLOCK: usize = HALO;
/// Weight of the noise of each scale, full resolution first: people see coarse noise better.
const SCALES: [f32; 4] = [1.0, 1.6, 5.3, 5.0];
/// Times the noise that is taken off the mask energy of the picture: what remains is texture for certain.
const CERTAIN: f32 = 2.0;
/// Texture energy, in squared 8-bit steps, from which masking sets in; energies fall as 1/√(1 +
/// texture/knee).
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

pub(super) const KIND: DescriptorKind = DescriptorKind {
    name: "compact",
    make: |parameters| Ok(Descriptor::new(Compact { mask: mask(parameters)? })),
};

/// See [`Descriptor::compact`].
#[derive(Debug)]
pub(super) struct Compact {
    pub(super) mask: NoiseMask,
}

impl TileDescriptor for Compact {
    fn name(&self) -> &'static str {
        KIND.name
    }

    fn version(&self) -> u16 {
        2
    }

    fn parameters(&self) -> BTreeMap<String, f64> {
        BTreeMap::from([("mask".to_owned(), f64::from(f32::from(self.mask)))])
    }

    fn number_names(&self) -> Vec<String> {
        NAMES.map(str::to_owned).to_vec()
    }

    fn own_len(&self) -> usize {
        OWN
    }

    fn describe(&self, planes: &TilePlanes) -> Result<Vec<f32>, DescriptorError> {
        Ok(describe(planes, self.mask).to_vec())
    }

    fn in_picture(&self, tiles: &[Described]) -> Vec<Vec<f32>> {
        in_picture(tiles)
    }

    fn visible_noise(&self, planes: &TilePlanes) -> Option<Array2<f32>> {
        Some(visible_noise(planes, self.mask))
    }

    fn pooled_visible_noise(&self, raw: &[f32]) -> Option<f32> {
        Some(pooled_amplitude(raw))
    }

    fn texture(&self) -> &[usize] {
        &TEXTURE
    }

    fn least_deviation(&self) -> f64 {
        LEAST_DEVIATION
    }

    fn project(&self, raw: &mut [f32], factor: f32) -> bool {
        project(raw, factor);
        true
    }
}

/// What the numbers are pooled from, on the grid of 8×8-pixel blocks, row-major, energies in squared 8-bit
/// steps; and room for what they are made from. Each thread keeps its own, so that a verdict allocates
/// nothing.
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
fn describe(planes: &TilePlanes, mask: NoiseMask) -> [f32; OWN] {
    Blocks::with(planes, mask, pool)
}

/// Pools over the blocks. Sums run over ratios to the largest energy, so that no power overflows.
fn pool(blocks: &Blocks) -> [f32; OWN] {
    let Blocks { visible, texture, .. } = blocks;
    let count = visible.len() as f32;
    let largest = visible.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    let pooled = visible.iter().map(|v| (v / largest).powi(POOLING / 2)).sum::<f32>() / count;
    let energy = largest * pooled.powf(2.0 / POOLING as f32);
    let log_amplitude = |energy: f32| 0.5 * energy.ln();
    [
        log_amplitude(energy + NOISE_FLOOR),
        texture.iter().map(|t| log_amplitude(t + TEXTURE_FLOOR)).sum::<f32>() / count,
        mean_texture(blocks),
    ]
}

/// The third number, for another descriptor.
pub(super) fn texture_energy(planes: &TilePlanes, mask: NoiseMask) -> f32 {
    Blocks::with(planes, mask, mean_texture)
}

fn mean_texture(Blocks { texture, .. }: &Blocks) -> f32 {
    0.5 * (texture.iter().sum::<f32>() / texture.len() as f32 + TEXTURE_FLOOR).ln()
}

/// The amplitude of visible noise at each pixel of the tile, that of its block, in 8-bit steps. Its mean of
/// order [`POOLING`] over the blocks is what the first number is the logarithm of.
fn visible_noise(planes: &TilePlanes, mask: NoiseMask) -> Array2<f32> {
    let (height, width) = (planes.inner.height, planes.inner.width);
    Blocks::with(planes, mask, |Blocks { visible, .. }| {
        let columns = width.div_ceil(BLOCK);
        Array2::from_shape_fn((height, width), |(y, x)| visible[y / BLOCK * columns + x / BLOCK].sqrt())
    })
}

/// The amplitude behind the first number, in 8-bit steps.
fn pooled_amplitude(descriptor: &[f32]) -> f32 {
    noise_energy(descriptor[0]).sqrt() as f32
}

/// Noise energy above the floor, of a noise number.
fn noise_energy(number: f32) -> f64 {
    f64::from(((2.0 * number).exp() - NOISE_FLOOR).max(0.0))
}

fn noise_number(energy: f64) -> f32 {
    (0.5 * (energy + f64::from(NOISE_FLOOR)).ln()) as f32
}

/// Appends to each tile's own numbers those of the picture that the tiles make up: root mean square of their
/// visible noise, and means of their texture numbers, by area. Noise is what the tile at hand has with its
/// own samples and the picture would have with as many: energies are taken to one sample, averaged, and
/// brought to the tile's samples.
fn in_picture(tiles: &[Described]) -> Vec<Vec<f32>> {
    let area: f64 = tiles.iter().map(|t| t.area).sum();
    let mean =
        |quantity: &dyn Fn(&Described) -> f64| tiles.iter().map(|t| t.area * quantity(t)).sum::<f64>() / area;
    let of_one_sample = mean(&|t| noise_energy(t.own[0]) * t.spp);
    let texture = [1, 2].map(|i| mean(&|t| f64::from(t.own[i])) as f32);
    let complete = |tile: &Described| {
        let picture = [noise_number(of_one_sample / tile.spp), texture[0], texture[1]];
        tile.own.iter().copied().chain(picture).collect()
    };
    tiles.iter().map(complete).collect()
}

/// Noise energy goes as 1/n, the picture's as the tile's; texture stays.
fn project(descriptor: &mut [f32], factor: f32) {
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

/// Mask energies of a plane with halo at full, half, quarter and eighth resolution, each on the grid of
/// 8×8-pixel blocks, in squared 8-bit steps; `rounding` is the known variance of white rounding noise in the
/// plane, which is taken off.
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
            // The halo is not summed: there are rows above and below
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

/// Means over blocks of `edge`×`edge` pixels of a plane of [width, height], without the halo, which is one
/// block wide; `add(y, sums)` adds row `y` to sums along columns.
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
mod tests;
