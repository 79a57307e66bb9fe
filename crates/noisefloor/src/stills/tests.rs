use super::*;

fn still(value: impl Fn(usize) -> f32) -> Still {
    let pixels = (0..32 * 32).map(|i| [value(i); 3]).collect();
    Still { size: (32, 32), pixels, spp: 16.0, display_referred: true, rounding: 0.0, origin: None }
}

/// Two pictures that share no samples.
fn pair<'a>(image: &'a Still, other: &'a Still) -> SnapshotPair<'a> {
    let (tone, samples) = (ToneMapping::default(), Some(Samples::Independent));
    SnapshotPair::new(Evidence::Halves, image, &[other], tone, samples).unwrap()
}

fn unlike(a: &Still, b: &Still) -> usize {
    pair(a, b).unlike_tiles(TileGrid::new(32, 32, 16).unwrap()).into_iter().filter(|unlike| *unlike).count()
}

#[test]
fn pictures_of_different_things_are_noticed_and_noise_is_not() {
    let mut noise = noisefloor_testkit::Noise::keyed(&[21]);
    let mut sparse = |share: f64| -> Vec<f32> {
        (0..32 * 32).map(|_| if noise.uniform() < share { 1.0 } else { 0.0 }).collect()
    };
    let (a, b) = (sparse(0.1), sparse(0.5));
    assert_eq!(unlike(&still(|_| 0.0), &still(|_| 1.0)), 4);
    // Brighter on the left alone, with noise of three display steps
    let step = |i: usize| if i % 32 < 16 { 0.2 } else { 0.0 };
    assert_eq!(unlike(&still(|i| 0.3 + 0.01 * a[i]), &still(|i| 0.3 + 0.01 * b[i] + step(i))), 2);
    // Few samples of a dim light look darker than many of them: that is noise
    assert_eq!(unlike(&still(|i| a[i]), &still(|i| b[i])), 0);
    assert_eq!(unlike(&still(|_| 0.5), &still(|_| 0.55)), 0);
}

/// A wall with a lamp in view whose own noise is larger than what the second picture lacks of the wall: 8 %, in all
/// blocks. By chance alone, blocks say so with p < 10⁻⁹; and of pictures with unlike numbers of samples they say nothing,
/// since most blocks of the noisier one are darker. Seeded.
#[test]
fn another_brightness_is_noticed_beside_a_lamp() {
    let warnings = |seed: u64, bright: f64, [one, other]: [f64; 2]| {
        let picture = |n: u64, bright: f64, spp: f64| {
            let mut noise = noisefloor_testkit::Noise::keyed(&[24, seed, n]);
            let mut light = |i: usize| {
                let lamp = i % 128 < 16 && i / 128 < 16;
                // One sample in 16 meets the light
                let met = (0..spp as usize).filter(|_| noise.uniform() < 1.0 / 16.0).count();
                (bright * if lamp { 50.0 } else { 0.3 } * 16.0 * met as f64 / spp) as f32
            };
            Still::new((128, 128), (0..128 * 128).map(|i| [light(i); 3]).collect(), spp)
        };
        let (one, other) = (picture(0, 1.0, one), picture(1, bright, other));
        pair(&one, &other).warnings()
    };
    for seed in 0..8 {
        let said = warnings(seed, 0.92, [256.0; 2]);
        assert!(
            matches!(said[..], [StillWarning::Brightness(times)] if (1.05..1.12).contains(&times)),
            "{said:?}"
        );
        for spp in [[256.0; 2], [16.0; 2], [4.0, 64.0], [64.0, 4.0]] {
            assert_eq!(warnings(seed, 1.0, spp), [], "{spp:?}");
        }
    }
}

fn judge(image: &Still, others: &[&Still]) -> Result<Samples, StillError> {
    let pair = SnapshotPair::new(Evidence::Halves, image, others, ToneMapping::default(), None)?;
    Ok(pair.samples())
}

/// A still of 32×32 pixels of noise of its own, with an origin.
fn of(noise: u64, seed: u64, options: &str) -> Still {
    let mut of = noisefloor_testkit::Noise::keyed(&[22, noise]);
    let values: Vec<f32> = (0..32 * 32).map(|_| 0.4 + 0.05 * of.normal() as f32).collect();
    let (source, options) = ("hall by a tracer".to_owned(), options.to_owned());
    let origin = SampleOrigin { source, options, seed, repeats: true };
    Still { origin: Some(origin), ..still(|i| values[i]) }
}

/// Two renders of one scene, renderer and seed are never independent, whatever their pixels look like.
#[test]
fn one_seed_is_never_independent_evidence() {
    let image = of(1, 1, "depth 8");
    assert_eq!(judge(&image, &[&of(2, 2, "depth 65")]).unwrap(), Samples::Independent);
    let error = judge(&image, &[&of(3, 1, "depth 65")]).unwrap_err();
    assert!(matches!(&error, StillError::Dependent { seed: 1, .. }), "{error}");
    assert!(error.to_string().contains("another seed"), "{error}");
}

/// What is given twice would count twice.
#[test]
fn the_same_picture_is_not_pooled_with_itself() {
    let (image, other) = (of(1, 1, ""), of(2, 2, ""));
    assert!(matches!(judge(&image, &[&other, &other]), Err(StillError::Twice(_))));
    let later = Still { spp: 32.0, ..of(3, 2, "") };
    assert!(matches!(judge(&image, &[&other, &later]), Err(StillError::Twice(_))));
    assert_eq!(judge(&image, &[&other, &of(4, 3, "")]).unwrap(), Samples::Independent);
    let plain = |still: &Still| Still { origin: None, ..still.clone() };
    let (tone, samples) = (ToneMapping::default(), Some(Samples::Independent));
    let twice = [&plain(&other), &plain(&other)];
    let error = SnapshotPair::new(Evidence::Halves, &plain(&image), &twice, tone, samples).unwrap_err();
    assert!(matches!(error, StillError::Twice(_)), "{error}");
    assert!(
        ["count twice", "leave one out"].iter().all(|words| error.to_string().contains(words)),
        "{error}"
    );
}

/// A wall of 128×128 pixels, rendered twice with 512 samples, of which one alone has found a lamp in the first of 16 tiles: the others are
/// likely to lack it, whichever picture has it, in any unit of light. Of the picture on a screen nobody knows what was found.
#[test]
fn finished_pictures_lack_light_that_one_alone_has_met() {
    const EDGE: usize = 128;
    let grid = TileGrid::new(EDGE, EDGE, 32).unwrap();
    let wall = |seed: u64, unit: f32, lamp: f32| {
        let mut noise = noisefloor_testkit::Noise::keyed(&[23, seed]);
        let mut pixel = || unit * 0.2 * (1.0 + 0.05 * noise.normal() / f64::sqrt(512.0)) as f32;
        let mut pixels: Vec<Rgb> = (0..EDGE * EDGE).map(|_| [pixel(); 3]).collect();
        pixels[5 * EDGE + 6] = [unit * (0.2 + lamp); 3];
        Still::new((EDGE, EDGE), pixels, 512.0)
    };
    let unmet = |a: &Still, b: &Still| {
        let judged = pair(a, b).judge(&Oracle::bundled(), grid, Audience::TRAINED).unwrap();
        // The windows of tiles 1, 4 and 5 have it in sight
        let beyond = [2, 3, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15].map(|tile| judged.verdicts()[tile]);
        assert!(beyond.iter().all(|verdict| verdict.open_for.is_some() != verdict.converged), "{beyond:?}");
        beyond.iter().filter(|verdict| verdict.open_for.is_some()).count()
    };
    for unit in [1.0, 1e-6, 1e6] {
        let [plain, lit] = [0.0, 2000.0].map(|lamp| wall(1, unit, lamp));
        let other = wall(2, unit, 0.0);
        assert_eq!(unmet(&plain, &other), 0, "{unit}");
        assert_eq!(unmet(&lit, &other), 12, "{unit}");
        assert_eq!(unmet(&other, &lit), 12, "{unit}");
        let shown = |still: &Still| still.clone().displayed_as_it_is(0.0);
        assert_eq!(unmet(&shown(&lit), &shown(&other)), 0, "{unit}");
    }
}

/// Threads look at parts of a picture: what all values have in common is that of all parts.
#[test]
fn values_of_large_pictures_are_looked_at_together() {
    const SIDE: usize = 300;
    const { assert!(SIDE * SIDE > 1 << 16) }
    let of_a_byte = |seed: u64| -> Vec<Rgb> {
        let mut noise = noisefloor_testkit::Noise::keyed(&[23, seed]);
        (0..SIDE * SIDE)
            .map(|_| [0; 3].map(|_: u8| (20.0 + 60.0 * noise.uniform() as f32).round() / 255.0))
            .collect()
    };
    let noticed = |last: f32| {
        let [mut a, b] = [1, 2].map(of_a_byte);
        a[SIDE * SIDE - 1] = [last; 3];
        let [a, b] = [a, b].map(|pixels| Still::new((SIDE, SIDE), pixels, 64.0));
        let warnings = pair(&a, &b).notice(TileGrid::new(SIDE, SIDE, 64).unwrap()).unwrap().warnings;
        warnings.contains(&StillWarning::Quantised(Encoding::Linear))
    };
    assert!(noticed(50.0 / 255.0) && !noticed(50.4 / 255.0));
}
