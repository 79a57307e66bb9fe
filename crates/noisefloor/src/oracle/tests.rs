use super::*;
use crate::descriptor::{Descriptor, TileDescriptor};
use crate::display::Display;
use crate::film::Film;
use crate::model::tests::{changed, small};
use crate::params::Audience;
use crate::rgb::Rgb;
use crate::svm::{Machine, Scaler, Svm};
use noisefloor_testkit::Noise;
use noisefloor_vision::{Viewing, VisionModel, VisionWorkspace};
use std::collections::BTreeMap;

/// A film of 64×64 pixels with `samples` samples of standard deviation `sigma` around grey.
fn film(samples: u64, sigma: f32) -> Film {
    film_of(|_| 0.2, samples, sigma)
}

/// The same around a picture that is given by the number of the pixel.
fn film_of(picture: fn(usize) -> f32, samples: u64, sigma: f32) -> Film {
    let mut film = Film::new(TileGrid::new(64, 64, 64).unwrap());
    let mut noise = Noise::new(5);
    for _ in 0..2 {
        let half = samples / 2;
        let batch: Vec<Rgb> = (0..64 * 64)
            .map(|i| [picture(i) + sigma * noise.normal() as f32 / (half as f32).sqrt(); 3])
            .collect();
        film.add(0, half, &batch).unwrap();
    }
    film
}

fn judge(oracle: &mut Oracle, film: &Film, reference: Option<&[Rgb]>) -> Result<Verdict, CriterionError> {
    let view = View { reference, ..View::new(film, &Display::SRGB) };
    Ok(oracle.judge(&view, &[film.grid().tile(0)])?[0])
}

#[cfg(feature = "bundled-model")]
#[test]
fn more_samples_are_less_visible_and_the_expected_need_is_near() {
    let mut oracle = Oracle::bundled();
    // A quarter of what is needed; from further away, noise that masks itself hides some of the need
    let few = judge(&mut oracle, &film(1_500, 0.5), None).unwrap();
    let many = judge(&mut oracle, &film(100_000, 0.5), None).unwrap();
    assert!(!few.converged && many.converged, "{few:?} {many:?}");
    // At the samples that were expected, another realisation of the noise is about at the threshold.
    let expected = few.expected_spp.unwrap();
    let there = judge(&mut oracle, &film(expected, 0.5), None).unwrap().probability.unwrap();
    assert!((0.9..0.98).contains(&there), "{expected}: {there}");
    assert_eq!(many.expected_spp, Some(100_000));
}

/// Where dots of one colour are as strong as tiles can stop with, they have cost as many JODs as grey ones are where these
/// stop, by the whole metric, within 0.05.
#[cfg(feature = "bundled-model")]
#[test]
fn noise_of_any_colour_stops_where_it_has_lost_as_much() {
    const EDGE: usize = 64;
    let (eyes, mut room) = (VisionModel::new(&Viewing::default()), VisionWorkspace::default());
    let display = Display::SRGB;
    let mut lost_at_the_stop = |colour: Rgb| {
        let mean_of = |film: &Film| -> Vec<Rgb> {
            (0..EDGE * EDGE).map(|i| display.encode(film.pixel(0, i))).collect()
        };
        let film = |strength: f32| {
            let (mut film, mut noise) = (Film::new(TileGrid::new(EDGE, EDGE, EDGE).unwrap()), Noise::new(5));
            for _ in 0..2 {
                let pixel = |dot: bool| colour.map(|c| if dot { 0.2 + strength * c } else { 0.2 }.max(0.0));
                let half: Vec<Rgb> = (0..EDGE * EDGE).map(|_| pixel(noise.uniform() < 0.01)).collect();
                film.add(0, 1000, &half).unwrap();
            }
            film
        };
        let (mut low, mut high) = (0.01f32, 10.0f32);
        while high / low > 1.02 {
            let middle = (low * high).sqrt();
            let stops = judge(&mut Oracle::bundled(), &film(middle), None).unwrap().converged;
            if stops { low = middle } else { high = middle }
        }
        let wall = vec![display.encode([0.2; 3]); EDGE * EDGE];
        10.0 - eyes.compare(&mean_of(&film(low)), &wall, (EDGE, EDGE), &mut room).unwrap().jod()
    };
    let grey = lost_at_the_stop([1.0; 3]);
    assert!((0.28..0.42).contains(&grey), "{grey}");
    // The last two have no luminance
    for colour in [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [0.0, 1.0, 1.0],
        [1.0, -0.297, 0.0],
        [0.0, -0.101, 1.0],
    ] {
        let lost = lost_at_the_stop(colour);
        // Greys show noise in red and green that has no luminance: where these stop, they have lost less
        let least = if colour[1] < -0.2 { grey - 0.06 } else { grey - 0.05 };
        assert!(lost > least && lost < grey + 0.05, "{colour:?}: {lost}, grey: {grey}");
    }
}

#[cfg(feature = "bundled-model")]
#[test]
fn a_reference_is_evidence_as_good_as_halves() {
    let model = changed(Model::bundled(), |m| m.evidence = Evidence::Reference).unwrap();
    let mut oracle = Oracle::new(model, People::DEFAULT);
    assert_eq!(oracle.needs(), Needs::REFERENCE);
    let (noisy, grey) = (film(200, 0.5), vec![Display::SRGB.encode([0.2; 3]); 64 * 64]);
    assert!(matches!(judge(&mut oracle, &noisy, None), Err(CriterionError::NoReference(_))));
    let by_reference = judge(&mut oracle, &noisy, Some(&grey)).unwrap().probability.unwrap();
    let by_halves = judge(&mut Oracle::bundled(), &noisy, None).unwrap().probability.unwrap();
    // The converged picture is known here: both residuals have the same noise, in other realisations.
    assert!((by_reference - by_halves).abs() < 0.1, "{by_reference} {by_halves}");
}

/// A tile that is converged is nowhere above 1 in the map, and one that is not is above 1 somewhere: whatever the
/// picture, the people and their eyes.
#[cfg(feature = "bundled-model")]
#[test]
fn the_map_and_the_verdict_are_one_thing() {
    let (mut converged, mut open) = (0, 0);
    for (samples, share) in [(400, 0.5), (1_500, 0.95), (6_000, 0.95), (6_000, 0.9), (25_000, 0.99)] {
        for (picture, factor) in [((|_| 0.2) as fn(usize) -> f32, 1.0), (checker, 1.0), (|_| 0.2, 2.0)] {
            let oracle = Oracle::new(Model::bundled(), People::new(share).unwrap());
            let film = film_of(picture, samples, 0.5);
            let tile = film.grid().tile(0);
            let planes = TilePlanes::from_halves(&film, &Display::SRGB, tile);
            let described = [oracle.describe(&planes, samples as f64).unwrap()];
            let audience = Audience { slope: factor, offset: 0.0 };
            let verdict = oracle.judge_described_for(&described, audience).unwrap()[0];
            let map = oracle.map_visible_noise(film.grid(), &described, audience).unwrap();
            let most = map.iter().copied().fold(0.0f32, f32::max);
            assert_eq!(verdict.converged, most <= 1.0, "{samples} {share} {factor}: {most} {verdict:?}");
            *if verdict.converged { &mut converged } else { &mut open } += 1;
            if let Some(need) = verdict.expected_spp.filter(|_| !verdict.converged) {
                // Noise as strong as the map says needs the square of that in samples
                let ratio = f64::from(most).powi(2) * samples as f64 / need as f64;
                assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
            }
        }
    }
    assert!(converged > 2 && open > 2, "{converged} {open}");
}

/// Single pixels of black and white: more contrast than any zone of the training data has.
#[cfg(feature = "bundled-model")]
fn checker(pixel: usize) -> f32 {
    if (pixel + pixel / 64).is_multiple_of(2) { 0.0 } else { 1.0 }
}

#[cfg(feature = "bundled-model")]
#[test]
fn what_nobody_was_asked_about_is_told_from_what_is_only_noisy_or_clean() {
    let verdict = |film: &Film| judge(&mut Oracle::bundled(), film, None).unwrap();
    // Flat: nothing to see, and nothing unheard of but black, of which nobody was asked.
    for (picture, black) in [((|_| 0.0) as fn(usize) -> f32, true), (|_| 1e-9, true), (|_| 0.2, false)] {
        let flat = verdict(&film_of(picture, 1 << 14, 0.0));
        assert!(flat.unfamiliar == black && flat.converged, "{flat:?}");
    }
    // Noise alone, however much, is no texture: it is not converged, and is expected to be.
    for sigma in [1.0, 10.0] {
        let noisy = verdict(&film_of(|_| 0.2, 100, sigma));
        assert!(!noisy.unfamiliar && !noisy.converged && noisy.expected_spp > Some(1000), "{noisy:?}");
    }
    // More contrast than any zone had: said, and done all the same when it is clean.
    let contrast = verdict(&film_of(checker, 1 << 14, 0.0));
    assert!(contrast.unfamiliar && contrast.converged, "{contrast:?}");
}

#[cfg(feature = "bundled-model")]
#[test]
fn an_unfamiliar_tile_gets_twice_the_samples() {
    let careless = changed(Model::bundled(), |m| m.familiarity = None).unwrap();
    let film = film_of(checker, 100, 2.0);
    let expected = |model: Model| {
        let verdict = judge(&mut Oracle::new(model, People::DEFAULT), &film, None).unwrap();
        assert!(!verdict.converged, "{verdict:?}");
        verdict.expected_spp.unwrap() as f64
    };
    let ratio = expected(Model::bundled()) / expected(careless);
    // The expected need is found to a fiftieth of a doubling, each time.
    assert!((ratio.log2() - 1.0).abs() < 0.04, "{ratio}");
}

/// People who need twice the samples see at 2n what the trained see at n, and expect twice the samples; who
/// need no more see the same.
#[cfg(feature = "bundled-model")]
#[test]
fn another_audience_sees_the_noise_of_fewer_samples() {
    let oracle = Oracle::bundled();
    let describe = |samples: u64| {
        let film = film(samples, 1.5);
        let planes = TilePlanes::from_halves(&film, &Display::SRGB, film.grid().tile(0));
        vec![oracle.describe(&planes, samples as f64).unwrap()]
    };
    let at = describe(400);
    let own = oracle.judge_described(&at)[0];
    assert_eq!(oracle.judge_described_for(&at, Audience::TRAINED).unwrap()[0], own);
    let for_line = |slope, offset| oracle.judge_described_for(&at, Audience { slope, offset }).unwrap()[0];
    // Half the demands are met by half the samples; a negative offset alone makes nobody see less.
    let lenient = for_line(0.5, 0.0);
    assert!(lenient.probability > own.probability, "{lenient:?} {own:?}");
    let need = |verdict: Verdict| verdict.expected_spp.unwrap() as f64;
    assert!((need(lenient) / need(own) - 0.5).abs() < 0.02, "{lenient:?} {own:?}");
    assert_eq!(for_line(1.0, -100.0).probability, own.probability);
    assert_eq!((Audience { slope: 0.5, offset: -10.0 }).seen_as(100.0), 200.0);
    let half = describe(200);
    let twice = for_line(2.0, 0.0);
    // Another film has other noise: its amplitude over 4096 pixels is known to 1 %.
    let half = oracle.judge_described(&half)[0];
    assert!((twice.probability.unwrap() - half.probability.unwrap()).abs() < 0.03, "{twice:?} {half:?}");
    let (own, twice) = (own.expected_spp.unwrap() as f64, twice.expected_spp.unwrap() as f64);
    assert!((twice / own - 2.0).abs() < 0.06, "{own} {twice}");
    let never = for_line(1.0, 1000.0);
    assert!(!never.converged && never.probability == Some(0.0) && never.expected_spp > Some(1000));
    assert_eq!(Audience { slope: 0.0, offset: 100.0 }.seen_as(100.0), 100.0);
    assert_eq!(Audience { slope: 0.0, offset: 101.0 }.seen_as(100.0), 0.0);
}

/// What is not known takes samples as its size asks for, and says so: an exposure known to 3.5 % takes hardly any, one that is
/// a guess takes many times as many; a tile without noise or light waits for neither.
#[cfg(feature = "bundled-model")]
#[test]
fn an_unknown_exposure_is_part_of_the_share_of_people() {
    let judge = |film: &Film, error: f64| {
        let view = View { exposure_error: error, ..View::new(film, &Display::SRGB) };
        Oracle::bundled().judge(&view, &[film.grid().tile(0)]).unwrap()[0]
    };
    let noisy = film(1_500, 0.5);
    let need = |error: f64| {
        judge(&noisy, error).expected_spp.unwrap() as f64 / judge(&noisy, 0.0).expected_spp.unwrap() as f64
    };
    // The need is found to a fiftieth of a doubling
    assert!((1.0..1.04).contains(&need(0.035)), "{}", need(0.035));
    assert!(need(0.3) > 1.04 && need(1.0) > 1.3, "{} {}", need(0.3), need(1.0));
    // Enough for the exposure that is estimated, but not for what else it may be
    let enough = film(judge(&noisy, 0.0).expected_spp.unwrap() * 5 / 4, 0.5);
    let of = |film: &Film, error: f64| judge(film, error).open_for;
    assert_eq!([0.0, 0.01, 1.0].map(|error| of(&enough, error)), [None, None, Some(OpenFor::Exposure)]);
    assert_eq!(of(&film(100, 0.5), 1.0), Some(OpenFor::Noise));
    assert_eq!(of(&film_of(|_| 0.0, 1 << 20, 0.0), 1.0), None);
}

/// Noise that few pixels carry is known as well as these are many.
#[cfg(feature = "bundled-model")]
#[test]
fn noise_in_few_pixels_takes_more_samples_than_noise_in_many() {
    let unknown = |carriers: f64| Unknown::new(0.0, carriers).noise;
    // One find is known to within a factor of two, a thousand to 3 %: ln(1 + 1/n)
    for (carriers, variance) in [(1.0, 2f64.ln()), (1000.0, 1e-3)] {
        assert!((unknown(carriers) / variance - 1.0).abs() < 1e-3, "{}", unknown(carriers));
    }
    assert_eq!(unknown(0.0), 0.0, "without noise there is none to be mistaken about");
    // At a threshold that is known, 95 % of people ask for as many times more as the odds have to be higher
    let spread = Spread { scenes: 0.4, people: 0.5 };
    let share = |above: f64, unknown| spread.share(above / 0.4 * std::f64::consts::PI / 3f64.sqrt(), unknown);
    let need = |unknown| {
        (0..4000).map(|i| f64::from(i) * 1e-3).find(|&above| share(above, unknown) >= 0.95).unwrap()
    };
    let [known, many, one] = [0.0, 1000.0, 1.0].map(|carriers| need(Unknown::new(0.0, carriers)));
    // z·(√(σ² + v) − σ) + v/2, with z = 1.645, σ² = 0.41, v = ln 2
    assert!(
        (many - known - 0.0018).abs() < 2e-3 && (one - known - 1.021).abs() < 2e-3,
        "{known} {many} {one}"
    );
    // Whoever asks for few people is not satisfied by not knowing
    assert!(share(-2.0, Unknown::new(1.0, 1.0)) <= share(-2.0, Unknown::default()));
}

/// A film of two tiles, the second much noisier, with `samples` samples.
fn two_tiles(samples: u64) -> Film {
    let mut film = Film::new(TileGrid::new(128, 64, 64).unwrap());
    for tile in 0..2 {
        let half = |seed: usize| -> Vec<Rgb> {
            let sign =
                |i: usize| if ((i * 7919 + seed * 104_729) / 31).is_multiple_of(2) { 1.0 } else { -1.0 };
            let sigma = if tile == 0 { 0.01 } else { 0.1 };
            (0..64 * 64).map(|i| [0.2 + sigma * sign(i); 3]).collect()
        };
        (1..=2).for_each(|seed| film.add(tile, samples / 2, &half(seed)).unwrap());
    }
    film
}

#[test]
fn tiles_are_judged_in_their_picture_whoever_is_asked_about() {
    let (film, fresh) = (two_tiles(100), || Oracle::new(small(), People::DEFAULT));
    let ask = |oracle: &mut Oracle, film: &Film, tiles: &[usize]| {
        let tiles: Vec<Tile> = tiles.iter().map(|&t| film.grid().tile(t)).collect();
        oracle.judge(&View::new(film, &Display::SRGB), &tiles).unwrap()
    };
    let both = ask(&mut fresh(), &film, &[0, 1]);
    assert_eq!(ask(&mut fresh(), &film, &[1, 0, 1]), [both[1], both[0], both[1]]);
    // What was found in another film is forgotten when this one begins.
    let mut used = fresh();
    ask(&mut used, &two_tiles(400), &[0, 1]);
    used.begin(film.grid());
    assert_eq!(ask(&mut used, &film, &[0])[0], both[0]);
    assert_eq!(used.described, {
        let mut o = fresh();
        ask(&mut o, &film, &[0]);
        o.described
    });
}

/// The residuals of a tile of one size: they tell neither noise from picture nor one display from another.
#[derive(Debug)]
struct Residuals {
    edge: usize,
}

impl TileDescriptor for Residuals {
    fn name(&self) -> &'static str {
        "residuals"
    }

    fn version(&self) -> u16 {
        1
    }

    fn parameters(&self) -> BTreeMap<String, f64> {
        BTreeMap::new()
    }

    fn number_names(&self) -> Vec<String> {
        (0..self.edge * self.edge).map(|i| i.to_string()).collect()
    }

    fn describe(&self, planes: &TilePlanes) -> Result<Vec<f32>, DescriptorError> {
        let (Tile { width, height, .. }, expected) = (planes.inner, self.edge);
        if (width, height) != (expected, expected) {
            return Err(DescriptorError::TileSize { expected, width, height });
        }
        Ok(planes.residual.inside(planes.inner).collect())
    }
}

#[test]
fn a_descriptor_of_one_tile_size_judges_no_other() {
    let descriptor = Descriptor::new(Residuals { edge: 64 });
    let n = descriptor.dimensions();
    let svm = Svm { gamma: 2.0, rho: 0.5, coefficients: vec![1.0], vectors: vec![0.0; n] };
    let model = changed(small(), |m| {
        m.descriptor = descriptor;
        (m.classifier.scaler, m.classifier.machine) = (Scaler::identity(n), Machine::Svm(svm));
        m.spread = None;
    });
    let model = model.unwrap();
    let mut oracle = Oracle::new(model, People::DEFAULT);
    // No noise, no residual: the support vector itself, f = 1 − ρ.
    let verdict = judge(&mut oracle, &film(100, 0.0), None).unwrap();
    assert!((verdict.probability.unwrap() - 1.0 / (1.0 + (-1f32).exp())).abs() < 1e-5);
    assert_eq!(verdict.expected_spp, None, "residuals alone do not tell noise from picture");
    assert!(!oracle.maps_visible_noise());
    let film = film(100, 0.0);
    let view = View::new(&film, &Display::SRGB);
    assert_eq!(oracle.visible_noise(&view), None);

    let mut ragged = Film::new(TileGrid::new(40, 64, 64).unwrap());
    (0..2).for_each(|_| ragged.add(0, 1, &[[0.0; 3]; 40 * 64]).unwrap());
    let error = judge(&mut oracle, &ragged, None).unwrap_err();
    assert!(matches!(error, CriterionError::TileSize { expected: 64, width: 40, .. }), "{error}");
}

#[test]
fn a_descriptor_that_knows_nothing_of_displays_refuses_another_one() {
    let grid = TileGrid::new(32, 32, 32).unwrap();
    let mut film = Film::new(grid);
    for value in [0.2, 0.3] {
        film.add(0, 10, &[[value; 3]; 1024]).unwrap();
    }
    let descriptor = Descriptor::new(Residuals { edge: 32 });
    let model = changed(small(), |m| {
        let n = descriptor.dimensions();
        m.classifier.scaler = Scaler::identity(n);
        let svm = Svm { gamma: 1.0, rho: 0.0, coefficients: vec![1.0], vectors: vec![0.0; n] };
        m.classifier.machine = Machine::Svm(svm);
        (m.descriptor, m.spread) = (descriptor, None);
    });
    let mut oracle = Oracle::new(model.unwrap(), People::DEFAULT);
    let tiles: Vec<Tile> = grid.tiles().collect();
    let mut judge =
        |viewing: Viewing| oracle.judge(&View::new(&film, &Display::SRGB).seen_on(viewing), &tiles);
    assert!(judge(Viewing::default()).is_ok());
    let error = judge("tv".parse().unwrap()).unwrap_err().to_string();
    assert!(error.contains("desk") && error.contains("tv"), "{error}");
}
