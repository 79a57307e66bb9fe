//! Contracts of the core, by somebody who knows its public interface alone: criteria that lie, pushes that are refused,
//! and pictures that are the same but for a symmetry. Every criterion has to keep them.

use noisefloor::criterion::{CriterionError, Needs, View};
use noisefloor::watch::{Fault, Warning};
use noisefloor::{
    Batch, Driver, DriverError, FixedSpp, Oracle, Params, ProgressiveSource, Request, Rgb, Schedule, Session,
    SessionError, SourceError, SourceInfo, StopReason, StoppingCriterion, Tile, ToneMapping, Verdict,
};
use noisefloor_denoise::{DenoiseError, DenoisedQuality, Denoiser, NoisyPicture};
use noisefloor_rivals::RIVALS;
use noisefloor_testkit::Noise;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;

type Boxed = Box<dyn StoppingCriterion + Send>;

/// The mean of 3×3 pixels: as linear as a denoiser can be, and the same in a mirror.
struct Blur;

impl Denoiser for Blur {
    fn name(&self) -> String {
        "blur".into()
    }

    fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError> {
        let (width, height) = picture.size;
        let near = |at: usize, edge: usize| at.saturating_sub(1)..(at + 2).min(edge);
        let mean = |i: usize| {
            let (x, y) = (i % width, i / width);
            let around = || near(y, height).flat_map(|y| near(x, width).map(move |x| y * width + x));
            let count = around().count() as f64;
            [0, 1, 2]
                .map(|c| (around().map(|at| f64::from(picture.radiance[at][c])).sum::<f64>() / count) as f32)
        };
        Ok((0..picture.radiance.len()).map(mean).collect())
    }
}

/// Every criterion there is that needs no reference and keeps no time, by name.
fn criteria() -> Vec<(String, Box<dyn Fn() -> Boxed>)> {
    let mut all: Vec<(String, Box<dyn Fn() -> Boxed>)> = vec![
        ("oracle".into(), Box::new(|| Box::new(Oracle::bundled()))),
        ("denoised".into(), Box::new(|| Box::new(DenoisedQuality::new(Blur, 0.3)))),
    ];
    let rivals = RIVALS.iter().filter(|rival| !(rival.make)(rival.default).needs().reference);
    all.extend(rivals.map(|rival| -> (String, Box<dyn Fn() -> Boxed>) {
        let default = if rival.name == "spp" { 64.0 } else { rival.default };
        (rival.name.into(), Box::new(move || (rival.make)(default)))
    }));
    all
}

/// Hills, a bright stripe and a checker, so that no symmetry leaves it as it is.
fn light(x: usize, y: usize) -> f64 {
    let (u, v) = (x as f64 / 64.0, y as f64 / 64.0);
    let hills = 0.35 + 0.15 * (9.0 * u + 4.0 * v * v).sin() + 0.1 * (5.0 * v - 13.0 * u * u).cos();
    let stripe = if (u - 1.3 * v + 0.2).abs() < 0.05 { 1.4 } else { 0.0 };
    hills + stripe + if (x / 6 + y / 9).is_multiple_of(2) { 0.08 } else { 0.0 }
}

/// The mean of samples `first` to `first + spp` of a pixel, with skewed noise as of paths.
fn sample(seed: u64, (x, y): (usize, usize), first: u64, spp: u64) -> Rgb {
    let one = |(x, y): (usize, usize), n| {
        let uniform = Noise::keyed(&[seed, x as u64, y as u64, n]).uniform();
        -uniform.max(1e-12).ln()
    };
    let sums = || -> Vec<f64> {
        let places = (0..EDGE * EDGE).map(|i| (i % EDGE, i / EDGE));
        let of_place =
            |place| (0..KEPT).scan(0.0, move |sum, n| Some(std::mem::replace(sum, *sum + one(place, n))));
        places.flat_map(of_place).collect()
    };
    let last = first + spp;
    let sum = if x < EDGE && y < EDGE && last < KEPT {
        let of_place = &SUMS[seed as usize].get_or_init(sums)[(y * EDGE + x) * KEPT as usize..];
        of_place[last as usize] - of_place[first as usize]
    } else {
        (first..last).map(|n| one((x, y), n)).sum()
    };
    [1.0, 0.8, 0.5].map(|c| (c * light(x, y) * sum / spp as f64) as f32)
}

/// Sums of the first samples of each pixel, none to `KEPT` less one, by seed: every criterion is shown the same.
static SUMS: [OnceLock<Vec<f64>>; 8] = [const { OnceLock::new() }; 8];
const KEPT: u64 = 401;

/// That of a whole picture of 64×64 pixels.
fn picture(seed: u64, first: u64, spp: u64) -> Vec<Rgb> {
    (0..EDGE * EDGE).map(|i| sample(seed, (i % EDGE, i / EDGE), first, spp)).collect()
}

const EDGE: usize = 64;
const TILE: usize = 32;

fn params() -> Params {
    Params::default().with_tile(TILE).with_max_spp(400).with_schedule(Schedule::Spaced { step: 16 })
}

fn cut(picture: &[Rgb], width: usize, tile: Tile) -> Vec<Rgb> {
    tile.rows(width).flat_map(|row| picture[row].to_vec()).collect()
}

/// How each tile has ended: samples, reason, and the probability to five digits.
type End = (u64, StopReason, Option<f32>);

fn ends<C: StoppingCriterion>(session: &Session<C>) -> Vec<End> {
    session.stops().map(|stop| (stop.spp, stop.reason, stop.probability)).collect()
}

/// Renders until all tiles are done, as a session asks, the picture changed in between.
fn render<C: StoppingCriterion>(
    session: &mut Session<C>,
    pixel: &dyn Fn((usize, usize), u64, u64) -> Rgb,
) -> Result<Vec<End>, SessionError> {
    for round in 0.. {
        assert!(round < 500, "no end at {} samples", session.film().spp(0));
        if session.is_done() {
            break;
        }
        for request in session.requests() {
            let Request { tile, first, spp, .. } = request;
            let at = |i: usize| (tile.x + i % tile.width, tile.y + i / tile.width);
            let mean: Vec<Rgb> = (0..tile.pixels()).map(|i| pixel(at(i), first, spp)).collect();
            session.push(tile.index, spp, &mean)?;
        }
        session.judge()?;
    }
    Ok(ends(session))
}

fn run(criterion: Boxed, params: Params) -> Vec<End> {
    let mut session = Session::new(EDGE, EDGE, criterion, params).unwrap();
    render(&mut session, &|at, first, spp| sample(1, at, first, spp)).unwrap()
}

// Implementers that lie

#[derive(Clone, Copy, Debug, PartialEq)]
enum Lie {
    None,
    TooFew,
    TooMany,
    Nothing,
    NotANumber,
    MoreThanCertain,
    Panic,
    Fails,
}

/// Satisfied at 100 samples; lies in one call, and says where it is called.
struct Liar {
    lie: Lie,
    at: u32,
    calls: u32,
}

impl StoppingCriterion for Liar {
    fn name(&self) -> String {
        "liar".into()
    }

    fn fingerprint(&self) -> String {
        self.name()
    }

    fn needs(&self) -> Needs {
        Needs::HALVES
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        self.calls += 1;
        let honest = |tile: &Tile| {
            Verdict::new(view.film.spp(tile.index) >= 100).expecting(Some(u64::MAX)).with_probability(0.5)
        };
        let mut verdicts: Vec<Verdict> = tiles.iter().map(honest).collect();
        let converged = |p| Verdict::new(true).with_probability(p);
        match self.lie {
            _ if self.calls != self.at => {}
            Lie::None => {}
            Lie::TooFew => drop(verdicts.pop()),
            Lie::TooMany => verdicts.push(converged(1.0)),
            Lie::Nothing => verdicts.clear(),
            Lie::NotANumber => verdicts.fill(converged(f32::NAN)),
            Lie::MoreThanCertain => verdicts.fill(converged(1.5)),
            Lie::Panic => panic!("as arranged"),
            Lie::Fails => return Err(CriterionError::NoReference(self.name())),
        }
        Ok(verdicts)
    }
}

const LIES: [Lie; 7] =
    [Lie::TooFew, Lie::TooMany, Lie::Nothing, Lie::NotANumber, Lie::MoreThanCertain, Lie::Panic, Lie::Fails];

/// No tile stops by a lie, and a session that goes on after one ends as if it had never been told.
#[test]
fn a_criterion_that_lies_is_an_error_and_nothing_else() {
    let render_through = |lie, at| {
        let mut session = Session::new(EDGE, EDGE, Liar { lie, at, calls: 0 }, params()).unwrap();
        let mut lies = 0;
        while !session.is_done() {
            for Request { tile, first, spp, .. } in session.requests() {
                let at = |i: usize| (tile.x + i % tile.width, tile.y + i / tile.width);
                // Light comes late, so that the exposure moves and everything is judged again
                let late = |at| sample(1, at, first, spp).map(|c| if first < 48 { c } else { 3.0 * c });
                let mean: Vec<Rgb> = (0..tile.pixels()).map(|i| late(at(i))).collect();
                session.push(tile.index, spp, &mean).unwrap();
            }
            let stops = session.stops().count();
            match catch_unwind(AssertUnwindSafe(|| session.judge())) {
                Ok(Ok(_)) => continue,
                Ok(Err(error)) => assert!(matches!(error, SessionError::Criterion(_)), "{lie:?}: {error}"),
                Err(_) => assert_eq!(lie, Lie::Panic),
            }
            lies += 1;
            assert_eq!(session.stops().count(), stops, "{lie:?}");
            session.expected_samples_to_go();
            session.judge().unwrap();
        }
        (lies, ends(&session))
    };
    let (_, honest) = render_through(Lie::None, 0);
    for lie in LIES {
        for at in 1..=4 {
            let (lies, end) = render_through(lie, at);
            assert_eq!((lies, &end), (1, &honest), "{lie:?} in call {at}");
        }
    }
}

/// A grey wall, without noise.
struct Wall;

impl ProgressiveSource for Wall {
    fn info(&self) -> SourceInfo {
        SourceInfo::new("wall", EDGE, EDGE)
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let batch = |r: &Request| Batch::new(r.tile, r.spp, vec![[0.2; 3]; r.tile.pixels()]);
        Ok(requests.iter().map(batch).collect())
    }
}

#[test]
fn a_driver_ends_whatever_its_criterion_returns() {
    for lie in LIES.into_iter().filter(|lie| *lie != Lie::Panic) {
        let mut driver = Driver::new(Wall, Liar { lie, at: 2, calls: 0 }, params()).unwrap();
        let error = driver.run(|_, _| ()).unwrap_err();
        assert!(matches!(error, DriverError::Criterion(_)), "{lie:?}: {error}");
        assert!(driver.session().stops().all(|stop| stop.reason == StopReason::Failed));
        assert!(driver.session().is_done());
    }
}

#[test]
fn expectations_without_end_are_no_overflow() {
    let huge = Params::default().with_max_spp(u64::MAX);
    let mut session = Session::new(512, 512, Liar { lie: Lie::None, at: 0, calls: 0 }, huge).unwrap();
    for _ in 0..2 {
        session.push_image(16, &vec![[0.5; 3]; 512 * 512]).unwrap();
    }
    session.judge().unwrap();
    assert_eq!(session.expected_samples_to_go(), Some(u64::MAX));
}

// What was refused was never there

fn snapshot<C: StoppingCriterion>(session: &Session<C>) -> Vec<u8> {
    let mut bytes = Vec::new();
    session.checkpoint("outside").unwrap().write(&mut bytes).unwrap();
    bytes
}

/// Any sequence of accepted and refused pushes is the accepted ones alone, in any order of tiles.
#[test]
fn refused_pushes_and_the_order_of_tiles_change_nothing() {
    let begin = || Session::new(EDGE, EDGE, Oracle::bundled(), params()).unwrap();
    let mut plain = begin();
    let grid = plain.film().grid();
    let tiles: Vec<Tile> = grid.tiles().collect();
    // One tile is far brighter than the others, and one has nothing but rounding
    let batch = |tile: Tile, round: u64| -> Vec<Rgb> {
        let factor = [1e6, 1.0, 1.0, 0.0][tile.index];
        let mean = cut(&picture(3, 16 * round, 16), EDGE, tile);
        mean.into_iter().map(|pixel| pixel.map(|c| c * factor)).collect()
    };
    let rounds: Vec<Vec<Vec<Rgb>>> =
        (0..6).map(|round| tiles.iter().map(|&tile| batch(tile, round)).collect()).collect();
    for round in &rounds {
        tiles.iter().for_each(|tile| plain.push(tile.index, 16, &round[tile.index]).unwrap());
        plain.judge().unwrap();
    }
    for seed in 0..12 {
        let mut noise = Noise::new(seed);
        let mut session = begin();
        for round in &rounds {
            let mut order: Vec<usize> = (0..tiles.len()).collect();
            (1..order.len()).for_each(|i| order.swap(i, noise.below(i + 1)));
            for tile in order {
                let pixels = tiles[tile].pixels();
                let refused: [(usize, u64, Vec<Rgb>); 7] = [
                    (tiles.len(), 16, vec![[0.5; 3]; pixels]),
                    (tile, 16, vec![[0.5; 3]; pixels - 1]),
                    (tile, 0, round[tile].clone()),
                    (tile, 1 << 40, round[tile].clone()),
                    (tile, 16, vec![[f32::NAN; 3]; pixels]),
                    (tile, 16, vec![[-1e12; 3]; pixels]),
                    (tile, 16, (0..pixels).map(|i| [if i % 2 == 0 { 9e29 } else { -1e30 }; 3]).collect()),
                ];
                let (at, spp, mean) = &refused[noise.below(refused.len())];
                assert!(session.push(*at, *spp, mean).is_err(), "{at}, {spp}");
                session.push(tile, 16, &round[tile]).unwrap();
            }
            session.judge().unwrap();
        }
        assert!(snapshot(&session) == snapshot(&plain), "seed {seed}");
        assert_eq!(session.warnings(), plain.warnings());
    }
}

#[test]
fn one_tile_says_nothing_of_the_light_of_another() {
    let refused = |order: [usize; 2]| {
        let mut session = Session::new(2 * EDGE, EDGE, FixedSpp(100), params().with_tile(EDGE)).unwrap();
        let mean = |tile| vec![[if tile == 0 { 1e6 } else { -500.0 }; 3]; EDGE * EDGE];
        order.map(|tile| (tile, session.push(tile, 8, &mean(tile)).is_err()))
    };
    assert_eq!(refused([0, 1]), [(0, false), (1, true)]);
    assert_eq!(refused([1, 0]), [(1, true), (0, false)]);
}

// Symmetries

/// Exposure by the log-average follows the unit of radiance, and so does everything else.
#[test]
fn the_unit_of_radiance_changes_no_verdict() {
    for (name, make) in criteria() {
        let scaled = |power: i32| {
            let mut session = Session::new(EDGE, EDGE, make(), params()).unwrap();
            let factor = f64::from(power).exp2() as f32;
            render(&mut session, &|at, first, spp| sample(1, at, first, spp).map(|c| c * factor)).unwrap()
        };
        let plain = scaled(0);
        for power in [-100, -37, 3, 60, 100] {
            assert_same(&scaled(power), &plain, &format!("{name}, 2^{power}"));
        }
    }
}

/// Of pictures that are the same but for rounding.
fn assert_same(one: &[End], other: &[End], what: &str) {
    assert_eq!(one.len(), other.len(), "{what}");
    for (one, other) in one.iter().zip(other) {
        let near = match (one.2, other.2) {
            (Some(p), Some(q)) => (p - q).abs() < 2e-3,
            (p, q) => p == q,
        };
        assert!(near && (one.0, one.1) == (other.0, other.1), "{what}: {one:?} and {other:?}");
    }
}

/// Of pictures that are the same, but lie otherwise on the grids of whoever looks at them: pyramids halve a picture from its
/// upper left, and windows step from there. A verdict may then come one step of the schedule, a quarter, sooner or later.
fn assert_alike(one: &[End], other: &[End], what: &str) {
    for (one, other) in one.iter().zip(other) {
        let times = one.0 as f64 / other.0 as f64;
        let near = match (one.2, other.2) {
            (Some(p), Some(q)) => one.0 != other.0 || (p - q).abs() < 0.03,
            (p, q) => p == q,
        };
        assert!(near && (0.7..1.45).contains(&times), "{what}: {one:?} and {other:?}");
    }
}

/// A picture in a mirror, or with rows for columns, is as noisy as it is.
#[test]
fn mirrors_change_no_verdict() {
    type Turn = (&'static str, fn(usize, usize) -> (usize, usize));
    let turns: [Turn; 3] = [
        ("mirrored", |x, y| (EDGE - 1 - x, y)),
        ("upside down", |x, y| (x, EDGE - 1 - y)),
        ("transposed", |x, y| (y, x)),
    ];
    for (name, make) in criteria() {
        let plain = run(make(), params());
        for (turn, place) in turns {
            let mut session = Session::new(EDGE, EDGE, make(), params()).unwrap();
            let turned =
                render(&mut session, &|(x, y), first, spp| sample(1, place(x, y), first, spp)).unwrap();
            let tiles = EDGE / TILE;
            let back = |tile: usize| {
                let (x, y) = place(tile % tiles * TILE, tile / tiles * TILE);
                turned[y / TILE * tiles + x / TILE]
            };
            let turned: Vec<End> = (0..turned.len()).map(back).collect();
            assert_alike(&turned, &plain, &format!("{name}, {turn}"));
        }
    }
}

/// Which half got which samples is chance.
#[test]
fn halves_may_be_exchanged() {
    for (name, make) in criteria() {
        let fed = |exchanged: bool| {
            let mut session = Session::new(EDGE, EDGE, make(), params().with_max_spp(192)).unwrap();
            let mut verdicts = Vec::new();
            for round in 0..6 {
                let mut pair = [0, 1].map(|half| {
                    let mut image = picture(5, 32 * round + 16 * half, 16);
                    // Fireflies of one half alone
                    if half == 0 && round == 0 {
                        (0..3).for_each(|dot| image[700 + 911 * dot] = [300.0; 3]);
                    }
                    image
                });
                if exchanged {
                    pair.reverse();
                }
                pair.iter().for_each(|image| session.push_image(16, image).unwrap());
                session.judge().unwrap();
                verdicts.extend((0..4).map(|tile| session.verdict(tile)));
            }
            (ends(&session), verdicts)
        };
        let (plain, verdicts) = fed(false);
        let (exchanged, others) = fed(true);
        assert_same(&exchanged, &plain, &name);
        for (one, other) in verdicts.iter().zip(&others) {
            let p =
                |verdict: &Option<Verdict>| verdict.and_then(|verdict| verdict.probability).unwrap_or(0.0);
            assert!((p(one) - p(other)).abs() < 2e-3, "{name}: {one:?} and {other:?}");
        }
    }
}

/// The same samples in batches of other sizes: other halves, and so other noise in the verdict, but no fault.
#[test]
fn batches_may_be_cut_otherwise() {
    for (name, make) in criteria() {
        let cut_by = |sizes: &[u64]| {
            let mut session = Session::new(EDGE, EDGE, make(), params().with_max_spp(400)).unwrap();
            session.set_linear();
            let mut had = 0;
            for &spp in sizes.iter().cycle() {
                if session.is_done() {
                    break;
                }
                let image = picture(7, had, spp);
                session.push_image(spp, &image).unwrap();
                had += spp;
                session.judge().unwrap_or_else(|error| panic!("{name}, {sizes:?}: {error}"));
            }
            assert_eq!(session.warnings(), [], "{name}, {sizes:?}");
            session.stops().map(|stop| stop.spp).sum::<u64>() as f64
        };
        let plain = cut_by(&[16]);
        for sizes in [&[8, 8][..], &[3, 3, 5, 5], &[32, 32]] {
            let times = cut_by(sizes) / plain;
            assert!((0.5..2.0).contains(&times), "{name}, {sizes:?}: {times}");
        }
    }
}

// Pictures without noise

fn hash(x: usize, y: usize) -> f32 {
    let mixed = ((x as u32).wrapping_mul(92_821) ^ (y as u32).wrapping_mul(68_917)).wrapping_mul(0x9E37_79B1);
    (mixed >> 16) as f32 / 65_536.0
}

/// Radiance of a pixel.
type Level = fn(usize, usize) -> f32;

const NOISELESS: [(&str, Level); 7] = [
    ("checker of black and white", |x, y| if (x + y).is_multiple_of(2) { 1.0 } else { 0.0 }),
    ("foliage", |x, y| 0.05 + 0.4 * hash(x, y)),
    ("of many decades", |x, y| (10.0 * hash(x, y)).exp()),
    ("lines", |x, _| if x % 4 < 2 { 1.0 } else { 0.01 }),
    ("black", |_, _| 0.0),
    ("white", |_, _| 1e4),
    ("a lamp", |x, y| if (x, y) == (5, 5) { 1e6 } else { 0.0 }),
];

/// Right samples without noise converge, whatever the texture.
#[test]
fn samples_without_noise_are_right() {
    for (name, level) in NOISELESS {
        let params = params().with_max_spp(2000);
        let mut session = Session::new(EDGE, EDGE, Oracle::bundled(), params.clone()).unwrap();
        let end =
            render(&mut session, &|(x, y), _, _| [level(x, y); 3]).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(end.iter().all(|end| end.0 <= 160 && end.1 == StopReason::Converged), "{name}: {end:?}");
        assert!(
            session.warnings().iter().all(|w| matches!(w, Warning::Constant(_))),
            "{:?}",
            session.warnings()
        );
        // In passes of one size nothing tells them from one seed for all batches, which is said
        let mut session = Session::new(EDGE, EDGE, Oracle::bundled(), params).unwrap();
        let image: Vec<Rgb> = (0..EDGE * EDGE).map(|i| [level(i % EDGE, i / EDGE); 3]).collect();
        for _ in 0..8 {
            session.push_image(16, &image).unwrap();
            session.judge().unwrap_or_else(|error| panic!("{name}: {error}"));
        }
        // Until they come in another size
        session.push_image(40, &image).unwrap();
        session.push_image(40, &image).unwrap();
        session.judge().unwrap();
        assert!(
            session.stops().all(|stop| stop.reason == StopReason::Converged) && session.is_done(),
            "{name}"
        );
    }
}

/// An object with noise before a background without, as previews have it.
#[test]
fn an_object_before_a_detailed_background_is_no_fault() {
    for radius in [0.0, 0.1, 0.2, 0.3, 0.45] {
        let edge = 192;
        let params = Params::default().with_tile(32).with_max_spp(120);
        let mut session = Session::new(edge, edge, Oracle::bundled(), params).unwrap();
        session.set_linear();
        let pixel = |(x, y): (usize, usize), first, spp| {
            let from_middle = [x, y].map(|at| at as f64 / edge as f64 - 0.5);
            if from_middle[0].hypot(from_middle[1]) < radius {
                sample(1, (x, y), first, spp)
            } else {
                [0.05 + 0.4 * hash(x, y); 3]
            }
        };
        render(&mut session, &pixel).unwrap_or_else(|error| panic!("{radius}: {error}"));
        assert_eq!(session.warnings(), [], "{radius}");
    }
}

// Limits and sizes

#[test]
fn odd_limits_hold() {
    for (name, make) in criteria() {
        for (least, most, step, consecutive) in
            [(0, 2, 2, 1), (3, 3, 2, 1), (5, 15, 3, 2), (17, 37, 7, 1), (1, 9, 1 << 40, 3)]
        {
            let params = Params::default()
                .with_tile(TILE)
                .with_min_spp(least)
                .with_max_spp(most)
                .with_schedule(Schedule::Every { step })
                .with_consecutive(consecutive);
            let end = run(make(), params);
            assert_eq!(end.len(), 4);
            assert!(end.iter().all(|end| (least..=most.max(2)).contains(&end.0)), "{name}, {most}: {end:?}");
        }
    }
}

#[test]
fn pictures_of_a_few_pixels_end() {
    for (name, make) in criteria() {
        for (width, height) in [(1, 1), (1, 64), (64, 1), (2, 2), (2, 64), (3, 5), (16, 16), (17, 3)] {
            for noise in [false, true] {
                let mut session = Session::new(width, height, make(), params().with_max_spp(300)).unwrap();
                let pixel = |at, first, spp| if noise { sample(1, at, first, spp) } else { [0.5; 3] };
                let end =
                    render(&mut session, &pixel).unwrap_or_else(|e| panic!("{name}, {width}×{height}: {e}"));
                let flat = noise || end.iter().all(|end| end.1.is_satisfied());
                assert!(flat, "{name}, {width}×{height}: {end:?}");
            }
        }
    }
}

// Light at the ends of what numbers hold

/// As the unit of radiance is nobody's business, so are its ends, unless it cannot be shown at all: that is an error.
#[test]
fn light_of_any_strength_is_judged_or_refused() {
    for power in [-149, -145, -140, -133, -131, -126, -110, 0, 100, 120, 126] {
        let factor = f64::from(power).exp2() as f32;
        let mut session = Session::new(EDGE, EDGE, Oracle::bundled(), params()).unwrap();
        let outcome = render(&mut session, &|at, first, spp| sample(1, at, first, spp).map(|c| c * factor));
        match outcome {
            Err(SessionError::Fault(Fault::Dim(_))) => assert!(power < -126, "{power}"),
            Err(error) => panic!("{power}: {error}"),
            Ok(end) => assert!(power >= -131 && end.iter().all(|end| end.0 > 100), "{power}: {end:?}"),
        }
        let exposure = session.display().map(noisefloor::display::Display::exposure);
        assert!(exposure.is_none_or(|exposure| exposure.is_finite() && exposure > 0.0), "{power}");
    }
    let odd = ToneMapping::Srgb { exposure: f32::NAN };
    assert!(odd.check().is_err() && catch_unwind(AssertUnwindSafe(|| odd.settle(&[[0.5; 3]]))).is_err());
}
