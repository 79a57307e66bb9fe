use super::*;
use crate::tile::Tile;
use noisefloor_testkit::Noise;
use noisefloor_vision::Viewing;
use proptest::prelude::*;

/// A seeded tile of 64×64 pixels with its halo: a ramp with a checker on it, and noise, four times as strong
/// in one corner.
#[derive(Clone, Copy)]
struct Recipe {
    seed: u64,
    base: f64,
    ramp: (f64, f64),
    checker: (f64, usize),
    noise: f64,
}

fn tile(Recipe { seed, base, ramp, checker, noise }: Recipe) -> TilePlanes {
    // Drawn as in the numpy implementation whose answers are recorded below, which is why it is not the testkit's `Noise`
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
    TilePlanes { image, residual, rounding: 0.0, viewing: Viewing::default(), inner }
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
    let mut planes = tile(Recipe { seed: 7, base: 0.5, ramp: (0.0, 0.0), checker: (0.0, 4), noise: 0.01 });
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

/// White noise of known σ on flat grey: a mask energy of σ²·gain/4ˢ at each scale s, weighted by scale and
/// brightness.
#[test]
fn the_map_shows_white_noise_as_strong_as_it_is() {
    let mut planes = tile(Recipe { seed: 7, base: 0.5, ramp: (0.0, 0.0), checker: (0.0, 4), noise: 0.01 });
    // Noise of one strength everywhere, and a picture without any, so that nothing passes for texture.
    let corner = |((y, x), v): ((usize, usize), &mut f32)| *v /= if x >= 56 && y < 24 { 4.0 } else { 1.0 };
    planes.residual.indexed_iter_mut().for_each(corner);
    planes.image.fill(0.5);
    let mask = NoiseMask::default();
    let map = visible_noise(&planes, mask);
    assert_eq!(map.dim(), (64, 64));

    let variance = 0.01 * 0.01 * 4.0 / 12.0 / (STEP * STEP);
    let scales: f32 = SCALES.iter().enumerate().map(|(s, w)| w / (1 << (2 * s)) as f32).sum();
    let brightness = (0.5 + BRIGHTNESS_OFFSET).powf(BRIGHTNESS_EXPONENT);
    let expected = variance * mask.white_noise_gain() * scales * brightness;
    // Half of the energy is in the first scale (standard error 2.5 %), a quarter, a fifth and a twentieth in
    // the others (5, 10, 20 %), as in `white_noise_has_the_energy_it_should`: 3 % in all; 4 σ.
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
        assert!((f64::from(descriptor[0]) - number).abs() < 1e-4, "seed {seed}: {descriptor:?}, {number}");
        assert!((f64::from(pooled_amplitude(&descriptor)) / mean - 1.0).abs() < 1e-4, "seed {seed}");
    }
}

/// The difference of two pictures whose R′, G′ and B′ were rounded to 8 bits has the energy that is known.
#[test]
fn rounding_has_the_energy_it_should() {
    let mut planes = tile(Recipe { seed: 7, base: 0.5, ramp: (0.0, 0.0), checker: (0.0, 4), noise: 0.0 });
    let mut noise = Noise::new(3);
    let mut rounded = || STEP * (noise.uniform() - noise.uniform()) as f32;
    for at in ndarray::indices((80, 80)) {
        let rgb = [rounded(), rounded(), rounded()];
        planes.residual[at] = crate::display::luminance(rgb);
    }
    let mask = NoiseMask::default();
    // In squared steps: two roundings, 1/12 each.
    let known = mask.white_noise_gain() * ROUNDING_LUMINANCE * 2.0 / 12.0;
    let [energy, ..] = energies_of(&planes.residual, mask);
    // 4096 pixels: a standard error below 3 %; 4 σ.
    assert!((mean(&energy) / known - 1.0).abs() < 0.12, "{energy:?} against {known}");
}

fn described(own: [f32; OWN], samples: f64, area: f64) -> Described {
    Described { own: own.to_vec(), spp: samples, area }
}

/// Two tiles, the second with three times the area and a quarter of the samples: at as many samples, energies
/// average.
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
