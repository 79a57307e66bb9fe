use crate::kit::{SIZE, Simple, noisy, truth};
use noisefloor::{Rgb, Tile, TileGrid, Viewing, display::Display};
use noisefloor_denoise::{DenoiseError, DenoisedError, DenoisedHalves, jods_lost_beside};
use noisefloor_testkit::Noise;
use noisefloor_vision::{VisionModel, VisionWorkspace};

/// What is estimated of halves with these seeds, and the true error of the mean of the denoised halves.
fn estimated_and_true(seeds: [u64; 2], deviation: f32, denoiser: Simple) -> [DenoisedError; 2] {
    let [a, b] = seeds.map(|seed| noisy(seed, deviation));
    let (da, db) = (denoiser.of(&a), denoiser.of(&b));
    let halves = DenoisedHalves { size: SIZE, noisy: [&a, &b], denoised: [&da, &db] };
    let mean: Vec<Rgb> =
        da.iter().zip(&db).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect();
    [
        DenoisedError::new(&halves, &Display::SRGB).unwrap(),
        DenoisedError::known(SIZE, &mean, &truth(), &Display::SRGB).unwrap(),
    ]
}

/// Root mean square of the residual, on the stripes and on the wall away from them, in 8-bit steps.
fn sizes(error: &DenoisedError) -> [f32; 2] {
    [0..64, 128..192].map(|columns| {
        let inside = error.residual().iter().enumerate().filter(|(i, _)| columns.contains(&(i % SIZE.0)));
        255.0 * (inside.map(|(_, r)| r * r).sum::<f32>() / 8192.0).sqrt()
    })
}

/// Without a denoiser, the error is the noise of the mean of both halves: 0.02/√2 of linear light.
#[test]
fn of_an_undenoised_picture_it_is_its_noise() {
    let [estimated, known] = estimated_and_true([1, 2], 0.02, Simple::Nothing).map(|e| sizes(&e));
    // Each is a root mean square of 8192 numbers: it errs by 0.8 %, their ratio by 1.1 %; 5 % is 4 σ and more
    for (e, k) in estimated.into_iter().zip(known) {
        assert!((e / k - 1.0).abs() < 0.05, "{estimated:?} and {known:?}");
    }
}

/// A denoiser that ignores its input errs by bias alone, and the halves do not differ.
#[test]
fn bias_is_seen_though_denoised_halves_agree() {
    let [estimated, known] = estimated_and_true([3, 4], 0.02, Simple::Flat(0.3)).map(|e| sizes(&e));
    // The stripes
    assert!((estimated[0] / known[0] - 1.0).abs() < 0.1, "{estimated:?} and {known:?}");
    // A wall has no bias; what chance makes of the noise of 10 steps stays below a sixth of it
    assert!(known[1] < 1e-3 && estimated[1] < 1.7, "{estimated:?} and {known:?}");
}

/// A denoiser that blurs: both parts, at several strengths of noise.
#[test]
fn a_blurring_denoiser_errs_as_estimated() {
    for (deviation, range) in [(0.01, 0.03), (0.03, 0.08), (0.06, 0.2)] {
        let [estimated, known] =
            estimated_and_true([5, 6], deviation, Simple::Bilateral(range)).map(|e| sizes(&e));
        for (e, k) in estimated.into_iter().zip(known) {
            // Where there is little bias, chance adds to it (measured: 0.95 to 1.19)
            assert!((0.85..1.3).contains(&(e / k)), "{deviation}, {range}: {estimated:?} and {known:?}");
        }
    }
}

/// The same in units of what people see, tile by tile.
#[test]
fn so_does_what_people_see_of_it() {
    let [estimated, known] = estimated_and_true([7, 8], 0.04, Simple::Bilateral(0.1));
    let (eyes, mut room) = (VisionModel::new(&Viewing::default()), VisionWorkspace::default());
    for tile in TileGrid::new(SIZE.0, SIZE.1, 64).unwrap().tiles() {
        let mut lost = |error: &DenoisedError| error.jods_lost(tile, &eyes, &mut room).unwrap();
        let (e, k) = (lost(&estimated), lost(&known));
        // Measured: 0.80 to 0.99
        assert!((0.7..1.15).contains(&(e / k)), "{tile:?}: {e} and {k} JOD");
    }
}

/// Blue noise, and what a denoiser leaves of it, is seen as the whole metric sees it, of which greys see next to nothing.
#[test]
fn errors_of_one_colour_are_seen() {
    let (eyes, mut room) = (VisionModel::new(&Viewing::default()), VisionWorkspace::default());
    let whole = TileGrid::new(SIZE.0, SIZE.1, SIZE.0.max(SIZE.1)).unwrap().tile(0);
    let blue = |pixels: &[Rgb]| -> Vec<Rgb> {
        truth().iter().zip(pixels).map(|(truth, pixel)| [truth[0], truth[1], pixel[2]]).collect()
    };
    for denoiser in [Simple::Nothing, Simple::Bilateral(0.3)] {
        let [a, b] = [41, 42].map(|seed| blue(&noisy(seed, 0.1)));
        let [da, db] = [&a, &b].map(|half| blue(&denoiser.of(half)));
        let halves = DenoisedHalves { size: SIZE, noisy: [&a, &b], denoised: [&da, &db] };
        let estimated = DenoisedError::new(&halves, &Display::SRGB).unwrap();
        let lost = estimated.jods_lost(whole, &eyes, &mut room).unwrap();
        let shown = |pixels: &[Rgb]| pixels.iter().map(|&p| Display::SRGB.encode(p)).collect::<Vec<Rgb>>();
        let mean: Vec<Rgb> =
            da.iter().zip(&db).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect();
        let jod = eyes.compare(&shown(&mean), &shown(&truth()), SIZE, &mut room).unwrap().jod();
        assert!((0.7..1.3).contains(&(lost / (10.0 - jod))), "{lost} and {} JOD", 10.0 - jod);
    }
}

/// In a film, what a denoiser leaves of the noise is new in every frame and averaged over, and what it removes of the
/// picture stands still.
#[test]
fn films_forgive_noise_and_not_bias() {
    let model = |rate| VisionModel::new(&Viewing::default().with_frames_per_second(rate).unwrap());
    let [still, slow, fast] = [None, Some(24.0), Some(60.0)].map(model);
    let mut room = VisionWorkspace::default();
    let stripes = TileGrid::new(SIZE.0, SIZE.1, 64).unwrap().tile(0);
    let mut lost =
        |error: &DenoisedError, eyes: &VisionModel| error.jods_lost(stripes, eyes, &mut room).unwrap();
    let [noise, _] = estimated_and_true([21, 22], 0.02, Simple::Nothing);
    let of_noise = [&still, &slow, &fast].map(|eyes| lost(&noise, eyes));
    assert!(of_noise.is_sorted_by(|a, b| *a > 1.2 * *b), "{of_noise:?}");
    let [bias, _] = estimated_and_true([23, 24], 0.001, Simple::Flat(0.3));
    let of_bias = [&still, &slow, &fast].map(|eyes| lost(&bias, eyes));
    // A film of a second counts 1/0.578 times as much as a still, to the power of 0.93 in JODs
    assert!((of_bias[1] / of_bias[0] - 1.665).abs() < 0.02, "{of_bias:?}");
    assert!((of_bias[2] / of_bias[1] - 1.0).abs() < 0.01, "{of_bias:?}");
}

/// Both parts, beside what one frame has new, and what many frames have in common.
#[test]
fn a_denoised_film_errs_as_estimated() {
    let denoiser = Simple::Bilateral(0.1);
    let frame = |seed: u64| {
        let [a, b] = [2 * seed, 2 * seed + 1].map(|seed| denoiser.of(&noisy(seed, 0.04)));
        a.iter().zip(&b).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect::<Vec<Rgb>>()
    };
    let frames: Vec<Vec<Rgb>> = (100..124).map(frame).collect();
    let shown = |linear: &Rgb| [Display::SRGB.luma(*linear); 3];
    let mut standing = vec![[0.0; 3]; truth().len()];
    for frame in &frames {
        for (sum, pixel) in standing.iter_mut().zip(frame) {
            *sum = std::array::from_fn(|c| sum[c] + shown(pixel)[c] / frames.len() as f32);
        }
    }
    let test: Vec<Rgb> = frames[0].iter().map(shown).collect();
    let reference: Vec<Rgb> = truth().iter().map(shown).collect();
    let [estimated, _] = estimated_and_true([7, 8], 0.04, denoiser);
    let mut room = VisionWorkspace::default();
    for rate in [24.0, 60.0] {
        let eyes = VisionModel::new(&Viewing::default().with_frames_per_second(Some(rate)).unwrap());
        let mut logs = Vec::new();
        for tile in TileGrid::new(SIZE.0, SIZE.1, 64).unwrap().tiles() {
            let part =
                |picture: &[Rgb]| tile.rows(SIZE.0).flatten().map(|i| picture[i]).collect::<Vec<Rgb>>();
            let [test, standing, reference] = [&test, &standing, &reference].map(|picture| part(picture));
            let size = (tile.width, tile.height);
            let known =
                10.0 - eyes.compare_frame(&test, &standing, &reference, size, &mut room).unwrap().jod();
            let found = estimated.jods_lost(tile, &eyes, &mut room).unwrap();
            // Measured: 0.70 to 1.67. At the edge of the stripes, bias there passes for some beside them
            assert!((0.6..1.8).contains(&(found / known)), "{rate}, {tile:?}: {found} and {known} JOD");
            logs.push((found / known).ln());
        }
        // Measured: 0.97 and 1.01
        let mean = (logs.iter().sum::<f64>() / logs.len() as f64).exp();
        assert!((0.9..1.1).contains(&mean), "{rate}: {mean}");
    }
}

/// Fireflies cannot pass for bias, whatever they are like.
#[test]
fn a_firefly_does_not_drown_the_rest() {
    let [a, mut b] = [9, 10].map(|seed| noisy(seed, 0.02));
    let flat = Simple::Flat(0.3).of(&a);
    let estimate = |a: &[Rgb], b: &[Rgb]| {
        let halves = DenoisedHalves { size: SIZE, noisy: [a, b], denoised: [&flat, &flat] };
        sizes(&DenoisedError::new(&halves, &Display::SRGB).unwrap())
    };
    let without = estimate(&a, &b);
    b[64 * SIZE.0 + 20] = [1e6; 3];
    let with = estimate(&a, &b);
    assert!((with[0] / without[0] - 1.0).abs() < 0.1, "{with:?} and {without:?}");
}

/// What a denoiser returns is compared with what it was given: an answer of another brightness is wrong,
/// however well the two halves agree about it. Known answers: black, far below, far above, and a little too
/// bright.
#[test]
fn another_brightness_counts() {
    let (eyes, mut room) = (VisionModel::new(&Viewing::default()), VisionWorkspace::default());
    let [a, b] = [11, 12].map(|seed| noisy(seed, 0.02));
    let mut lost = |[da, db]: [&[Rgb]; 2]| -> f64 {
        let halves = DenoisedHalves { size: SIZE, noisy: [&a, &b], denoised: [da, db] };
        let error = DenoisedError::new(&halves, &Display::SRGB).unwrap();
        let tiles = TileGrid::new(SIZE.0, SIZE.1, 64).unwrap().tiles();
        tiles.map(|tile| error.jods_lost(tile, &eyes, &mut room).unwrap()).fold(f64::INFINITY, f64::min)
    };
    for wrong in [-1.0, 0.0, -1e6, 3e38, 0.4] {
        let flat = Simple::Flat(wrong).of(&a);
        let least = lost([&flat, &flat]);
        assert!(least > 0.3, "{wrong}: {least} JOD");
    }
    // The truth loses nothing, nor does the noise of both halves in a wall: its mean is right within its
    // noise
    let wall = Simple::Flat(0.3).of(&a);
    assert!(lost([&wall, &wall]) < 0.05);
    let gain = |picture: &[Rgb]| -> Vec<Rgb> { picture.iter().map(|p| p.map(|c| 1.2 * c)).collect() };
    let (bright, right) = ([gain(&a), gain(&b)], lost([&a, &b]));
    assert!(lost([&bright[0], &bright[1]]) > right + 0.3);
}

/// A firefly that a denoiser removes is no loss of brightness: the mean was no better known.
#[test]
fn a_removed_firefly_is_no_shift() {
    let (eyes, mut room) = (VisionModel::new(&Viewing::default()), VisionWorkspace::default());
    let [mut a, b] = [13, 14].map(|seed| noisy(seed, 0.02));
    let wall = Simple::Flat(0.3).of(&a);
    a[20 * SIZE.0 + 150] = [1e6; 3];
    let halves = DenoisedHalves { size: SIZE, noisy: [&a, &b], denoised: [&wall, &wall] };
    let error = DenoisedError::new(&halves, &Display::SRGB).unwrap();
    let tile = TileGrid::new(SIZE.0, SIZE.1, 64).unwrap().tile(2);
    let lost = error.jods_lost(tile, &eyes, &mut room).unwrap();
    // The firefly itself may pass for 0.16 JOD of bias; a shift to white would be an edge of several
    assert!(lost < 0.3, "{lost}");
}

#[test]
fn pictures_of_other_sizes_are_refused() {
    let (a, b) = (noisy(1, 0.1), noisy(2, 0.1));
    let halves = DenoisedHalves { size: SIZE, noisy: [&a, &b], denoised: [&a, &b[..100]] };
    let outcome = DenoisedError::new(&halves, &Display::SRGB);
    assert!(matches!(outcome, Err(DenoiseError::Pixels { got: 100, .. })));
    assert!(DenoisedError::known(SIZE, &a, &b[1..], &Display::SRGB).is_err());
}

/// A denoiser that works in tiles leaves a line between them: bias in one pixel of 64.
#[test]
fn seams_are_seen() {
    let size = (128, 128);
    let ramp = |i: usize| {
        [1.0, 0.8, 0.6].map(|c| c * (0.1 + (0.5 * (i / 128) as f32 + 0.4 * (i % 128) as f32) / 128.0))
    };
    let truth: Vec<Rgb> = (0..size.0 * size.1).map(ramp).collect();
    let with_noise = |seed: u64, deviation: f32| -> Vec<Rgb> {
        let mut noise = noisefloor_testkit::Noise::new(seed);
        truth.iter().map(|pixel| pixel.map(|c| c + deviation * noise.normal() as f32)).collect()
    };
    let (eyes, mut room) = (VisionModel::new(&Viewing::default()), VisionWorkspace::default());
    let grid = TileGrid::new(128, 128, 64).unwrap();
    type Seam = fn(usize) -> bool;
    let seams: [(&str, Seam); 3] =
        [("none", |_| false), ("columns", |i| i % 128 % 64 == 32), ("rows", |i| i / 128 % 64 == 32)];
    for (name, is_seam) in seams {
        for height in [0.15, 0.3, 0.6] {
            let denoised = [11, 12].map(|seed| {
                let mut picture = with_noise(seed, 0.003);
                let seam = picture.iter_mut().enumerate().filter(|(i, _)| is_seam(*i));
                seam.for_each(|(_, pixel)| *pixel = pixel.map(|c| c * (1.0 + height)));
                picture
            });
            let noisy = [1, 2].map(|seed| with_noise(seed, 0.05));
            let [a, b] = denoised.each_ref().map(Vec::as_slice);
            let mean: Vec<Rgb> =
                a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect();
            let halves =
                DenoisedHalves { size, noisy: noisy.each_ref().map(Vec::as_slice), denoised: [a, b] };
            let display = noisefloor::ToneMapping::default().settle(&truth);
            let estimated = DenoisedError::new(&halves, &display).unwrap();
            let known = DenoisedError::known(size, &mean, &truth, &display).unwrap();
            for tile in grid.tiles() {
                let [lost, right] =
                    [&estimated, &known].map(|e| e.jods_lost(tile, &eyes, &mut room).unwrap());
                println!("{name} {height} tile {}: {lost:.3} for {right:.3}", tile.index);
                // Nearly as well as other errors are known: in its darkest third, the row of 15 % is within the noise
                let fits = if name == "none" { lost < 0.15 } else { (0.5..1.8).contains(&(lost / right)) };
                assert!(fits, "{name}, {height}, tile {}: {lost} for {right}", tile.index);
            }
        }
    }
}

/// A finished picture beside another render of four times its samples: what it has lost itself, the noise of the other taken off.
#[test]
fn a_picture_beside_another_render_has_lost_what_it_has() {
    let (eyes, mut room) = (VisionModel::new(&Viewing::default()), VisionWorkspace::default());
    type Kind = fn(&mut Noise) -> Rgb;
    // Grey noise; half of its variance in dots, of which one pixel in 50 has one; blue noise
    let dots = |noise: &mut Noise| {
        let dot = if noise.uniform() < 0.02 { 4.9 } else { 0.0 };
        [(0.72 * noise.normal() + dot - 0.098) as f32; 3]
    };
    let kinds: [(Kind, f32); 3] = [
        (|noise| [noise.normal() as f32; 3], 0.04),
        (dots, 0.04),
        (|noise| [0.0, 0.0, 3.0 * noise.normal() as f32], 0.02),
    ];
    let with_noise = |kind: Kind, seed: u64, deviation: f32| -> Vec<Rgb> {
        let mut noise = Noise::new(seed);
        let add = |pixel: Rgb| {
            let noise = kind(&mut noise);
            std::array::from_fn(|c| pixel[c] + deviation * noise[c])
        };
        truth().into_iter().map(add).collect()
    };
    let cut = |picture: &[Rgb], tile: Tile| -> Vec<Rgb> {
        tile.rows(SIZE.0).flatten().map(|pixel| picture[pixel]).collect()
    };
    let mut ratios = Vec::new();
    for ((kind, most), denoiser) in
        kinds.into_iter().flat_map(|kind| [Simple::Nothing, Simple::Bilateral(0.1)].map(|d| (kind, d)))
    {
        for deviation in [0.125, 0.25, 0.5, 1.0].map(|share| share * most) {
            let picture = denoiser.of(&with_noise(kind, 51, deviation));
            let [a, b] = [52, 53].map(|seed| with_noise(kind, seed, deviation / 2f32.sqrt()));
            for tile in TileGrid::new(SIZE.0, SIZE.1, 64).unwrap().tiles() {
                let [picture, a, b, truth] = [&picture, &a, &b, &truth()].map(|p| cut(p, tile));
                let size = (tile.width, tile.height);
                let estimated = jods_lost_beside(size, &picture, [&a, &b], &Display::SRGB, &eyes).unwrap();
                let known = DenoisedError::known(size, &picture, &truth, &Display::SRGB).unwrap();
                let known = known.jods_lost(Tile { index: 0, x: 0, y: 0, ..tile }, &eyes, &mut room).unwrap();
                if (0.1..2.0).contains(&known) {
                    ratios.push(estimated / known);
                } else {
                    assert!(
                        known > 2.0 || estimated < 0.15,
                        "{denoiser:?}, {deviation}: {estimated} for {known}"
                    );
                }
            }
        }
    }
    ratios.sort_by(f64::total_cmp);
    println!("{ratios:.2?}");
    // Measured: 0.73 to 1.31, the middle half within 0.1
    assert!(ratios.len() > 60 && ratios[0] > 0.65 && ratios[ratios.len() - 1] < 1.45, "{ratios:.2?}");
    let (low, high) = (ratios[ratios.len() / 4], ratios[3 * ratios.len() / 4]);
    assert!(low > 0.85 && high < 1.15, "{low} to {high}");
    let pictures = [vec![[0.5; 3]; 16], vec![[0.5; 3]; 15]];
    assert!(
        jods_lost_beside((4, 4), &pictures[0], [&pictures[0], &pictures[1]], &Display::SRGB, &eyes).is_err()
    );
}
