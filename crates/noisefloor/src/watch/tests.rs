//! What is said of each mistake, and that nothing is said of what is right.

use super::*;
use crate::{FixedSpp, Params, Schedule, Session, SessionError, source::PixelNoise};
use noisefloor_testkit::Noise;

const EDGE: usize = 128;
/// Samples per pixel of a batch.
const SPP: u64 = 10;

/// Linear radiance of a batch: a checker on a ramp, in skewed noise. `seed` is all that the noise depends on.
fn batch(seed: u64, spp: u64) -> Vec<Rgb> {
    let mut noise = Noise::new(seed);
    let pixel = |i: usize| {
        let (x, y) = (i % EDGE, i / EDGE);
        let radiance = 0.1 + 0.004 * x as f64 + if (x / 6 + y / 9).is_multiple_of(2) { 0.2 } else { 0.0 };
        let light: f64 = (0..spp).map(|_| -noise.uniform().max(1e-12).ln()).sum::<f64>() / spp as f64;
        [1.0, 0.8, 0.5].map(|c| (c * radiance * light) as f32)
    };
    (0..EDGE * EDGE).map(pixel).collect()
}

/// Pushes pictures until `spp` are there or something is said: what, and at how many samples per pixel.
fn feed(spp: u64, mut picture: impl FnMut(u64) -> (u64, Vec<Rgb>)) -> (Option<Fault>, u64, Vec<Warning>) {
    let schedule = Schedule::Spaced { step: 10 };
    let params = Params { tile: 64, max_spp: 1 << 30, min_spp: 0, schedule, ..Params::default() };
    let mut session = Session::new(EDGE, EDGE, FixedSpp(1 << 29), params).unwrap();
    let mut had = 0;
    for count in 0.. {
        let (new, image) = picture(count);
        for tile in session.film().grid().tiles().collect::<Vec<_>>() {
            let mean: Vec<Rgb> = tile.rows(EDGE).flat_map(|row| image[row].to_vec()).collect();
            match session.push(tile.index, new, &mean) {
                Err(SessionError::Fault(fault)) => return (Some(fault), had, session.warnings().to_vec()),
                other => other.unwrap(),
            }
        }
        had += new;
        match session.judge() {
            Err(SessionError::Fault(fault)) => return (Some(fault), had, session.warnings().to_vec()),
            other => drop(other.unwrap()),
        }
        if had >= spp {
            break;
        }
    }
    (None, had, session.warnings().to_vec())
}

/// Independent batches, changed.
fn changed(spp: u64, change: impl Fn(&mut Vec<Rgb>)) -> (Option<Fault>, u64, Vec<Warning>) {
    feed(spp, |count| {
        let mut image = batch(count + 1, SPP);
        change(&mut image);
        (SPP, image)
    })
}

/// (a·one + b·other) pixel by pixel.
fn mixed(a: f32, one: &[Rgb], b: f32, other: &[Rgb]) -> Vec<Rgb> {
    one.iter().zip(other).map(|(p, q)| std::array::from_fn(|c| a * p[c] + b * q[c])).collect()
}

#[test]
fn independent_samples_are_silent() {
    assert_eq!(changed(400, |_| ()), (None, 400, Vec::new()));
    // As a session asks for them, and from one sample on
    let sizes = |count: u64| [1, 1, 2, 2, 4, 4, 8, 8, 16, 16, 35, 35][(count as usize).min(11)];
    assert_eq!(feed(200, |count| (sizes(count), batch(count + 1, sizes(count)))).2, Vec::new());
}

/// The mistakes of issue 31, with the samples per pixel at which they are noticed; without this watch the tiles
/// of a Cornell box stopped at 170, 100, 540 and 100.
#[test]
fn mistakes_are_faults_before_a_tile_can_stop() {
    let mut sum = vec![[0.0; 3]; EDGE * EDGE];
    let (running, at, _) = feed(1000, |count| {
        sum = mixed(1.0, &sum, 1.0, &batch(count + 1, SPP));
        (SPP, mixed(1.0 / (count + 1) as f32, &sum, 0.0, &sum))
    });
    assert!(matches!(running, Some(Fault::Running { correlation }) if correlation > 0.3), "{running:?}");
    assert!(at <= 50, "{at}");

    let (again, at, _) = feed(1000, |_| (SPP, batch(1, SPP)));
    assert_eq!((again, at), (Some(Fault::Repeated { tiles: 4, of: 4 }), 20));
    // Every second half is the first again
    let (halves, at, _) = feed(1000, |count| (SPP, batch(1 + count / 2, SPP)));
    assert_eq!((halves, at), (Some(Fault::Repeated { tiles: 4, of: 4 }), 20));

    let to_8_bits = |decode: bool| {
        move |image: &mut Vec<Rgb>| {
            for value in image.iter_mut().flatten() {
                let code = (crate::display::srgb_encode(*value) * 255.0).round() / 255.0;
                *value = if decode { crate::display::srgb_decode(code) } else { code };
            }
        }
    };
    let quantised = |encoding, at| (Some(Fault::Quantised { encoding }), at, Vec::new());
    assert_eq!(changed(1000, to_8_bits(false)), quantised(Encoding::Linear, 20));
    assert_eq!(changed(1000, to_8_bits(true)), quantised(Encoding::Srgb, 20));
    assert_eq!(
        changed(1000, |image| image.iter_mut().flatten().for_each(|c| *c = (*c * 99.0).round())).0,
        quantised(Encoding::Linear, 20).0
    );

    let dark = changed(1000, |image| image.fill([-1.0; 3]));
    assert!(matches!(dark, (Some(Fault::Light { light: ImpossibleLight::Negative { .. }, .. }), 0, _)));
    let nan = changed(1000, |image| image.fill([f32::NAN; 3]));
    assert!(matches!(nan, (Some(Fault::Light { light: ImpossibleLight::NotFinite { .. }, .. }), 0, _)));
}

/// Two batches to a tile's first verdict are too few to be sure by; no tile stops before more have come.
#[test]
fn running_means_in_the_batches_asked_for_stop_no_tile() {
    let params = Params { tile: 64, ..Params::default() };
    let mut session = Session::new(EDGE, EDGE, crate::Oracle::bundled(), params).unwrap();
    let (mut sum, mut had) = (vec![[0.0; 3]; EDGE * EDGE], 0);
    let fault = (1..).find_map(|seed| {
        let spp = session.requests()[0].spp;
        sum = mixed(1.0, &sum, spp as f32, &batch(seed, spp));
        had += spp;
        for tile in session.film().grid().tiles().collect::<Vec<_>>() {
            let mean =
                tile.rows(EDGE).flat_map(|row| mixed(1.0 / had as f32, &sum[row.clone()], 0.0, &sum[row]));
            session.push(tile.index, spp, &mean.collect::<Vec<_>>()).unwrap();
        }
        match session.judge() {
            Ok(stops) => {
                assert_eq!(stops, [], "{had}");
                None
            }
            Err(error) => Some(error),
        }
    });
    assert!(matches!(fault, Some(SessionError::Fault(Fault::Running { .. }))), "{fault:?}");
    assert!(had <= 150, "{had}");
    assert!(matches!(session.warnings(), [Warning::Noise(times)] if *times > 10.0));
}

#[test]
fn overlapping_batches_and_changing_scenes_are_faults() {
    // Seeds count samples, and batches begin where the last was half done
    let window = |count| mixed(0.5, &batch(count + 1, 5), 0.5, &batch(count + 2, 5));
    let (overlapping, at, _) = feed(1000, |count| (SPP, window(count)));
    assert!(matches!(overlapping, Some(Fault::Shared { .. })), "{overlapping:?}");
    assert!(at <= 80, "{at}");
    // After 60 samples a light is switched off, in stripes of shadow or everywhere
    let switched = |stripes: usize| {
        feed(200, move |count| {
            let mut image = batch(count + 1, SPP);
            let dark = if count < 6 { 1.0 } else { 0.3 };
            for (_, pixel) in image.iter_mut().enumerate().filter(|(i, _)| i % EDGE % stripes < 32) {
                *pixel = pixel.map(|c| c * dark);
            }
            (SPP, image)
        })
    };
    let (moved, at, _) = switched(64);
    assert!(matches!(moved, Some(Fault::Shared { .. })), "{moved:?}");
    assert!(at <= 110, "{at}");
    let (fault, _, warnings) = switched(32);
    assert_eq!(fault, None);
    assert!(warnings.iter().any(|w| matches!(w, Warning::Changing(c) if *c > 0.2)), "{warnings:?}");
}

#[test]
fn a_pixel_filter_is_a_warning_unless_it_was_announced() {
    let blur = |image: &mut Vec<Rgb>| {
        for row in image.chunks_mut(EDGE) {
            let sharp = row.to_vec();
            for x in 1..EDGE - 1 {
                row[x] = std::array::from_fn(|c| (sharp[x - 1][c] + sharp[x][c] + sharp[x + 1][c]) / 3.0);
            }
        }
    };
    let (fault, _, warnings) = changed(100, blur);
    assert_eq!(fault, None);
    // Two thirds of their samples in common
    assert!(matches!(warnings[..], [Warning::Neighbours(c)] if (c - 0.67).abs() < 0.1), "{warnings:?}");

    let params = Params { tile: 64, min_spp: 0, ..Params::default() };
    let mut session = Session::new(EDGE, EDGE, FixedSpp(1 << 12), params).unwrap();
    session.set_pixels(PixelNoise::Shared);
    for count in 0..8 {
        let mut image = batch(count + 1, SPP);
        blur(&mut image);
        for tile in session.film().grid().tiles().collect::<Vec<_>>() {
            let mean: Vec<Rgb> = tile.rows(EDGE).flat_map(|row| image[row].to_vec()).collect();
            session.push(tile.index, SPP, &mean).unwrap();
        }
        session.judge().unwrap();
    }
    assert_eq!(session.warnings(), []);
}

#[test]
fn what_is_likely_is_said_once_with_its_number() {
    // Every second batch mirrors the one before at the mean, as complementary points do
    let (fault, _, warnings) = feed(400, |count| {
        let image = batch(1 + count / 2, SPP);
        let mean = batch(1, 1000);
        (SPP, if count % 2 == 0 { image } else { mixed(1.6, &mean, -0.6, &image) })
    });
    assert_eq!(fault, None);
    let anti = |w: &&Warning| matches!(w, Warning::Anticorrelated(c) if *c < -0.2);
    assert_eq!(warnings.iter().filter(anti).count(), 1, "{warnings:?}");

    // 10 samples each, whatever is said: 10, 10, 20, 20
    let (fault, _, warnings) = feed(3000, |count| (SPP << (count / 2 % 2), batch(count + 1, SPP)));
    assert_eq!(fault, None);
    assert!(matches!(warnings[..], [Warning::Counts(f)] if (f - 2.0).abs() < 0.3), "{warnings:?}");

    // Cut off at white
    let (fault, _, warnings) =
        changed(100, |image| image.iter_mut().flatten().for_each(|c| *c = (3.0 * *c).min(1.0)));
    assert_eq!(fault, None);
    assert!(matches!(warnings[..], [Warning::Clipped(share)] if share > 5.0), "{warnings:?}");

    assert_eq!(changed(100, |image| image.fill([0.25; 3])), (None, 100, vec![Warning::Constant(0.25)]));
}

/// A picture without noise is no repetition, unless it is rough all over.
#[test]
fn pictures_without_noise_are_silent() {
    let ramp = |_| (SPP, (0..EDGE * EDGE).map(|i| [0.001 * (i % EDGE) as f32 + 0.1, 0.2, 0.3]).collect());
    assert_eq!(feed(100, ramp), (None, 100, Vec::new()));
    // An unlit texture of 8 bits, rounded a little differently each time
    let texture = |count: u64| {
        let rounding = 1.0 + (count % 3) as f32 * f32::EPSILON;
        let texel = |i: usize| (i % EDGE / 16 * 29 + i / EDGE / 16 * 31) % 256;
        let value = |i: usize| crate::display::srgb_decode(texel(i) as f32 / 255.0) * rounding;
        (SPP, (0..EDGE * EDGE).map(|i| [value(i); 3]).collect())
    };
    assert_eq!(feed(100, texture).0, None);
}

/// Brightness that wanders for all pixels as one, as of a Markov chain, and patches that share noise.
#[test]
fn noise_in_common_is_no_fault() {
    for seed in 0..12 {
        let (fault, ..) = feed(400, |count| {
            let mut image = batch(1000 * seed + count + 1, SPP);
            let mut common = Noise::new(77 + 1000 * seed + count);
            let whole = 1.0 + 0.2 * (common.uniform() - 0.5);
            let patches: Vec<f64> = (0..64).map(|_| 1.0 + 0.3 * (common.uniform() - 0.5)).collect();
            for (i, pixel) in image.iter_mut().enumerate() {
                let patch = patches[i / EDGE / 16 * 8 + i % EDGE / 16];
                *pixel = pixel.map(|c| c * (whole * patch) as f32);
            }
            (SPP, image)
        });
        assert_eq!(fault, None, "seed {seed}");
    }
}
