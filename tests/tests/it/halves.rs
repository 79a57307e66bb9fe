//! Halves are equals, and light that one of them alone has found is seen. These tests know the public interface alone.

use crate::kit::Bilateral;
use noisefloor::{
    Oracle, Params, Request, Rgb, Session, Stop, StopReason, StoppingCriterion, ToneMapping, Verdict,
    display::{Display, ToneCurve},
    tune::{Looked, PicturePair},
};
use noisefloor_denoise::DenoisedQuality;
use noisefloor_testkit::Noise;
use noisefloor_vision::{Viewing, VisionModel, VisionWorkspace};

type Criterion = Box<dyn StoppingCriterion + Send>;

const SIZE: (usize, usize) = (96, 64);

/// Three greys beside each other.
fn truth(pixel: usize) -> f32 {
    let (x, y) = (pixel % SIZE.0, pixel / SIZE.0);
    if x < SIZE.0 / 3 {
        0.15
    } else if y >= SIZE.1 / 2 && x >= SIZE.0 / 2 {
        0.8
    } else {
        0.4
    }
}

/// The mean of some samples: relative noise of this strength, and `dots` pixels that are `times` as bright.
fn rendered(noise: &mut Noise, strength: f64, dots: usize, times: f32) -> Vec<Rgb> {
    let mut picture: Vec<Rgb> = (0..SIZE.0 * SIZE.1)
        .map(|pixel| [(f64::from(truth(pixel)) * (1.0 + strength * noise.normal())).max(0.0) as f32; 3])
        .collect();
    for _ in 0..dots {
        let pixel = noise.below(picture.len());
        picture[pixel] = [truth(pixel) * times; 3];
    }
    picture
}

/// What a session makes of these halves: verdicts, map of the noise, picture, and need.
#[derive(Debug, PartialEq)]
struct Outcome {
    stops: Vec<Stop>,
    verdicts: Vec<Option<Verdict>>,
    map: Option<Vec<u32>>,
    picture: Vec<Rgb>,
    to_go: Option<u64>,
    share: Option<f64>,
}

fn outcome(criterion: Criterion, params: &Params, halves: [(u64, &[Rgb]); 2]) -> Outcome {
    let mut session = Session::new(SIZE.0, SIZE.1, criterion, params.clone()).unwrap();
    for (spp, half) in halves {
        session.push_image(spp, half).unwrap();
    }
    let stops = session.judge().unwrap();
    Outcome {
        stops,
        verdicts: (0..session.film().grid().len()).map(|tile| session.verdict(tile)).collect(),
        map: session.visible_noise().map(|map| map.into_iter().map(f32::to_bits).collect()),
        picture: session.film().image(),
        to_go: session.expected_samples_to_go(),
        share: session.share_in_picture(),
    }
}

fn tones() -> Vec<ToneMapping> {
    let film = ToneCurve::new(b"film", |exposed| exposed.map(|c| (c / (c + 0.2)).powf(0.7)));
    vec![
        ToneMapping::default(),
        ToneMapping::Srgb { exposure: 1.0 },
        ToneMapping::Custom { exposure: 1.0, curve: film },
        ToneMapping::Custom { exposure: 1.0, curve: agx_like() },
    ]
}

/// A table like AgX: a curve of the logarithm with a toe and a shoulder, and colours that fade as they get bright.
fn agx_like() -> ToneCurve {
    let (edge, toe, top) = (17, 0.01, 16.0);
    let radiances = ToneCurve::table_radiances(edge, toe, top).unwrap();
    let curve = |radiance: f32| {
        let at = ((radiance.max(1e-6) / 0.18).log2() + 10.0) / 16.5;
        1.0 / (1.0 + (-9.0 * (at.clamp(0.0, 1.0) - 0.6)).exp())
    };
    let mut values = Vec::new();
    for b in &radiances {
        for g in &radiances {
            for r in &radiances {
                let grey = (r + g + b) / 3.0;
                values.push([r, g, b].map(|c| curve(0.8 * c + 0.2 * grey)));
            }
        }
    }
    ToneCurve::of_table(edge, toe, top, values).unwrap()
}

/// Exchanging even halves changes nothing to the bit, with light that one of them alone has. (Of uneven ones, the order
/// matters in one way: a second batch that has more samples may be a total, and verdicts wait for two more.)
#[test]
fn exchanged_halves_are_judged_alike() {
    let criteria: [fn() -> Criterion; 2] =
        [|| Box::new(Oracle::bundled()), || Box::new(DenoisedQuality::new(Bilateral, 0.5))];
    let (mut noise, mut judged) = (Noise::new(3), 0);
    for (case, (na, nb)) in [(64, 64), (36, 36), (100, 100), (64, 64), (200, 200)].into_iter().enumerate() {
        for (tone, viewing) in tones().into_iter().zip(["desk", "desk,fps=24", "desk", "desk,peak=600"]) {
            let params = Params::default().with_tile(32).with_min_spp(4);
            let params = params.with_tone_mapping(tone).with_viewing(viewing.parse().unwrap());
            let strength = [0.01, 0.1, 0.3][case % 3];
            // Of 64 samples; noise that does not fall with them is doubted
            let of = |samples: u64| strength * (64.0 / samples as f64).sqrt();
            let a = rendered(&mut noise, of(na), case, 1000.0);
            let b = rendered(&mut noise, of(nb), 2 * case, 30.0);
            for make in criteria {
                let [one, other] = [[(na, &a[..]), (nb, &b[..])], [(nb, &b[..]), (na, &a[..])]];
                let one = outcome(make(), &params, one);
                judged += one.verdicts.iter().flatten().count();
                assert_eq!(one, outcome(make(), &params, other), "{na} and {nb} samples, {viewing}");
            }
        }
    }
    assert!(judged > 150, "{judged} tiles were judged");
}

/// A picture and its three mirror images are as noisy as each other, whether dots lie in odd or even columns and rows: within
/// 1 % in the median without dots, within 8 % with a few of them and 10 % with one, and within 15 % at most; the bounds with
/// dots are what was found, rounded up. Sides are multiples of tiles, which mirror onto each other.
#[test]
fn mirrored_pictures_are_judged_alike() {
    let mirror = |pixel: usize, image: usize| {
        let (x, y) = (pixel % SIZE.0, pixel / SIZE.0);
        let turned = |at: usize, side: usize, bit: usize| if image & bit > 0 { side - 1 - at } else { at };
        turned(y, SIZE.1, 2) * SIZE.0 + turned(x, SIZE.0, 1)
    };
    let params = Params::default().with_tile(32);
    let mut random = Noise::new(19);
    for (dots, times, median) in [(0, 0.0, 1.01), (3, 3.0, 1.08), (1, 30.0, 1.1)] {
        let ratio_of = |_| {
            let halves = [0, 1].map(|_| rendered(&mut random, 0.03, dots, times));
            let strongest = [0, 1, 2, 3].map(|image| -> f32 {
                let mirrored = |half: &Vec<Rgb>| -> Vec<Rgb> {
                    (0..half.len()).map(|pixel| half[mirror(pixel, image)]).collect()
                };
                let [a, b] = halves.each_ref().map(mirrored);
                let halves = [(64, &a[..]), (64, &b[..])];
                let map = outcome(Box::new(Oracle::bundled()), &params, halves).map.unwrap();
                map.into_iter().map(f32::from_bits).fold(0.0, f32::max)
            });
            strongest.into_iter().fold(0.0, f32::max) / strongest.into_iter().fold(f32::MAX, f32::min)
        };
        let mut ratios: Vec<f32> = (0..24).map(ratio_of).collect();
        ratios.sort_by(f32::total_cmp);
        assert!(ratios[0] >= 1.0 && ratios[12] < median && ratios[23] < 1.15, "{dots} dots: {ratios:?}");
    }
}

/// JODs that a window of the mean around a pixel has lost against the truth, and how white that pixel is.
fn lost_around(pixel: usize, mean: &[Rgb], display: &Display, room: &mut VisionWorkspace) -> (f64, f32) {
    const WINDOW: usize = 28;
    let (x, y) = (pixel % SIZE.0, pixel / SIZE.0);
    let from = |at: usize, side: usize| at.saturating_sub(WINDOW / 2).min(side - WINDOW);
    let (left, top) = (from(x, SIZE.0), from(y, SIZE.1));
    let window = || (top..top + WINDOW).flat_map(|y| (left..left + WINDOW).map(move |x| y * SIZE.0 + x));
    let shown: Vec<Rgb> = window().map(|pixel| display.encode(mean[pixel])).collect();
    let right: Vec<Rgb> = window().map(|pixel| display.encode([truth(pixel); 3])).collect();
    let eyes = VisionModel::new(&Viewing::default());
    let jod = eyes.compare(&shown, &right, (WINDOW, WINDOW), room).unwrap().jod();
    (10.0 - jod, display.luma(mean[pixel]))
}

/// A white dot that the vision model sees in the mean of all samples is in no tile that stops as converged: few dots or
/// many, however bright, in either half or in both, on whatever noise, however the picture is shown, at the number of
/// samples from which all noise is trusted and after it.
#[test]
fn a_dot_that_is_seen_is_in_no_tile_that_stops() {
    let mut random = Noise::new(11);
    let mut room = VisionWorkspace::default();
    let (mut seen, mut stopped) = (0, 0);
    let mut missed = Vec::new();
    for case in 0..160 {
        let between = |random: &mut Noise, low: f64, high: f64| low * (high / low).powf(random.uniform());
        let dots = between(&mut random, 1.0, 100.5) as usize;
        let times = between(&mut random, 10.0, 1e5) as f32;
        let strength = between(&mut random, 1.0, 300.0) / 1000.0 * 0.1;
        let tone = tones().swap_remove(case % 4);
        let spp = [50, 52, 64, 500][case / 4 % 4];
        let of_half = [dots, [0, dots][case / 16 % 2]];
        let mut halves = of_half.map(|dots| rendered(&mut random, strength, dots, times));
        if case / 32 % 2 == 1 {
            halves.swap(0, 1);
        }
        let params = Params::default().with_tile(64).with_min_spp(2 * spp).with_tone_mapping(tone);
        let mut session = Session::new(SIZE.0, SIZE.1, Oracle::bundled(), params).unwrap();
        halves.iter().for_each(|half| session.push_image(spp, half).unwrap());
        let stops = session.judge().unwrap();
        stopped += stops.len();
        let (mean, display) = (session.film().image(), session.display_so_far());
        let bright = |&pixel: &usize| halves.iter().any(|half| half[pixel][0] > 5.0 * truth(pixel));
        for pixel in (0..SIZE.0 * SIZE.1).filter(bright) {
            let (lost, shown) = lost_around(pixel, &mean, &display, &mut room);
            if lost < 0.3 || shown < 0.99 {
                continue;
            }
            seen += 1;
            let tile = session.film().grid().index_at(pixel % SIZE.0, pixel / SIZE.0);
            if stops.iter().any(|stop| stop.tile.index == tile && stop.reason == StopReason::Converged) {
                missed.push((case, dots, times, strength, lost, session.verdict(tile).unwrap().probability));
            }
        }
    }
    println!("{seen} dots seen, {stopped} tiles stopped");
    assert!(missed.is_empty(), "{} of {seen}: {missed:?}", missed.len());
    assert!(seen > 1000 && stopped > 0, "{seen} {stopped}");
}

/// One sample of 10,000 times the light of its picture holds the four tiles whose windows have it, and no other: these take a
/// tenth more samples at most, over all twelve, where one that waits would take five times as many.
#[test]
fn a_dot_holds_no_tile_that_it_does_not_touch() {
    const EDGE: usize = 256;
    const TOUCHED: [usize; 4] = [0, 1, 4, 5];
    let ends = |dot: f32| -> Vec<Stop> {
        let params = Params::default().with_tile(64).with_max_spp(600);
        let mut session = Session::new(EDGE, EDGE, Oracle::bundled(), params).unwrap();
        while !session.is_done() {
            for Request { tile, spp, first, .. } in session.requests() {
                let mut noise = Noise::keyed(&[tile.index as u64, first]);
                let spread = 0.3 / (spp as f64).sqrt();
                let pixel = |pixel: usize| {
                    let light = if pixel % EDGE < 85 { 0.12 } else { 0.3 };
                    let dot = if pixel == 70 * EDGE + 70 && first == 0 { dot / spp as f32 } else { 0.0 };
                    [light * (1.0 + spread * noise.normal()) as f32 + dot; 3]
                };
                let batch: Vec<Rgb> = tile.rows(EDGE).flatten().map(pixel).collect();
                session.push(tile.index, spp, &batch).unwrap();
            }
            session.judge().unwrap();
        }
        session.stops().collect()
    };
    let [without, with] = [0.0, 1e4 * 0.2].map(ends);
    assert!(without.iter().all(|stop| stop.reason == StopReason::Converged), "{without:?}");
    assert!(TOUCHED.iter().all(|&tile| with[tile].reason == StopReason::MaxSpp), "{with:?}");
    let apart = |stops: &[Stop]| -> u64 {
        stops.iter().filter(|stop| !TOUCHED.contains(&stop.tile.index)).map(|stop| stop.spp).sum()
    };
    let [without, with] = [without, with].map(|stops| apart(&stops));
    assert!(10 * with <= 11 * without, "{with} {without}");
}

/// Two pictures of one view are the halves of a session: one number for both, whichever comes first.
#[test]
fn two_pictures_are_two_halves() {
    let mut noise = Noise::new(5);
    for (case, strength) in [0.002, 0.02, 0.1].into_iter().enumerate() {
        for tone in tones() {
            let [a, b] = [2, 0].map(|dots| rendered(&mut noise, strength, case * dots, 1000.0));
            let params = Params::default().with_tile(64).with_min_spp(128).with_tone_mapping(tone);
            let judge = |one: &[Rgb], other: &[Rgb]| {
                let pair = PicturePair::new(SIZE, [one.to_vec(), other.to_vec()], 64.0).unwrap();
                pair.look(&Oracle::bundled(), &params, None).unwrap()
            };
            let looked = judge(&a, &b);
            assert_eq!(looked, judge(&b, &a));
            let mut session = Session::new(SIZE.0, SIZE.1, Oracle::bundled(), params.clone()).unwrap();
            session.push_image(64, &a).unwrap();
            session.push_image(64, &b).unwrap();
            session.judge().unwrap();
            assert_eq!(session.visible_noise().unwrap(), looked.map);
        }
    }
}

/// Two pictures wait as a session does whose film has them as its halves: for light that they are likely to lack, and where
/// noise cannot be trusted yet.
#[test]
fn two_pictures_are_guarded_as_a_session_is() {
    // One dot in a large clean picture holds its tile; what else it says, the session says of the other tiles
    let mut noise = Noise::new(9);
    let [clean, other] = [0, 0].map(|_| rendered(&mut noise, 0.001, 0, 1.0));
    let mut dotted = clean.clone();
    dotted[40 * SIZE.0 + 20] = [900.0; 3];
    let params = Params::default().with_tile(32).with_tone_mapping(ToneMapping::Srgb { exposure: 1.0 });
    for (spp, one, enough) in
        [(10, &clean, false), (24, &clean, false), (200, &clean, true), (200, &dotted, false)]
    {
        let pair = PicturePair::new(SIZE, [one.clone(), other.clone()], spp as f64).unwrap();
        let Looked { excess, map, .. } = pair.look(&Oracle::bundled(), &params, None).unwrap();
        let mut session =
            Session::new(SIZE.0, SIZE.1, Oracle::bundled(), params.clone().with_min_spp(2)).unwrap();
        session.push_image(spp, one).unwrap();
        session.push_image(spp, &other).unwrap();
        let stops = session.judge().unwrap().len();
        let done = stops == session.film().grid().len();
        assert_eq!((excess.ratio <= 1.0, done), (enough, enough), "{spp}: {excess:?}, {stops} stops");
        assert_eq!(session.visible_noise().unwrap(), map);
        let trusted = 100.0 / (2 * spp) as f64;
        assert!(excess.ratio >= trusted.sqrt() || trusted < 1.0, "{spp}: {excess:?}");
    }
}
