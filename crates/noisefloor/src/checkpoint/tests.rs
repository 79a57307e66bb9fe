use super::*;
use crate::criterion::{FixedSpp, Needs, StoppingCriterion, Verdict};
use crate::driver::{Driver, Event};
use crate::oracle::Oracle;
use crate::source::{Batch, ProgressiveSource, Repeats, Request, SourceError, SourceInfo};
use crate::tests::{judging_each, saved};
use proptest::prelude::*;
use std::sync::atomic::Ordering;

/// Noise that follows from pixel and sample alone, and more of it to the right.
struct Noise(Repeats);

impl ProgressiveSource for Noise {
    fn info(&self) -> SourceInfo {
        SourceInfo::new("noise", 96, 48).with_repeats(self.0)
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let sample = |x: usize, y: usize, n: u64| {
            let noise = noisefloor_testkit::Noise::keyed(&[(y * 96 + x) as u64, n]).uniform();
            0.2 + 0.01 * x as f32 * (noise as f32 - 0.5)
        };
        let batch = |&Request { tile, first, spp: samples, .. }: &Request| {
            let pixel = |i: usize| {
                let (x, y) = (tile.x + i % tile.width, tile.y + i / tile.width);
                [(first..first + samples).map(|n| sample(x, y, n)).sum::<f32>() / samples as f32; 3]
            };
            Batch { tile, spp: samples, mean: (0..tile.pixels()).map(pixel).collect() }
        };
        Ok(requests.iter().map(batch).collect())
    }
}

fn params() -> Params {
    Params {
        tile: 16,
        min_spp: 20,
        max_spp: 2000,
        schedule: crate::Schedule::Every { step: 20 },
        ..Params::default()
    }
}

/// A driver of the job, broken off after some batches.
fn broken_off<C: StoppingCriterion>(criterion: C, batches: usize) -> Driver<Noise, C> {
    broken_off_with(criterion, params(), batches)
}

fn broken_off_with<C: StoppingCriterion>(criterion: C, params: Params, batches: usize) -> Driver<Noise, C> {
    let mut driver = Driver::new(Noise(Repeats::Samples), criterion, params).unwrap();
    assert_eq!(run_for(&mut driver, batches), None);
    driver
}

fn kept<S: ProgressiveSource, C: StoppingCriterion>(driver: &Driver<S, C>) -> Vec<u8> {
    saved(driver.session())
}

/// Resumed with a larger limit, a finished render goes on; where verdicts come at the same samples whatever the limit, as
/// one that was never limited. A smaller limit is refused.
#[cfg(feature = "bundled-model")]
#[test]
fn a_finished_run_goes_on_with_more_samples() {
    let with =
        |max_spp| Driver::new(Noise(Repeats::Samples), Oracle::bundled(), params().with_max_spp(max_spp));
    let mut whole = with(400).unwrap();
    whole.run(|_, _| ()).unwrap();
    let mut limited = with(100).unwrap();
    limited.run(|_, _| ()).unwrap();
    assert!(limited.session().stops().any(|stop| stop.reason == crate::StopReason::MaxSpp));
    let bytes = kept(&limited);
    let mut resumed = with(400).unwrap().resume("job", Checkpoint::read(&bytes[..]).unwrap()).unwrap();
    assert!(!resumed.session().is_done());
    resumed.run(|_, _| ()).unwrap();
    assert!(kept(&resumed) == kept(&whole));
    let smaller = with(80).unwrap().resume("job", Checkpoint::read(&bytes[..]).unwrap());
    let words = smaller.map(drop).unwrap_err().to_string();
    assert!(words.contains("its most samples per pixel is 100, not 80"), "{words}");
}

/// A finished run of a criterion is resumed with one that asks for more, and with no other: tiles that it does not satisfy go
/// on, and all have at least what they had.
fn goes_on_with<C: StoppingCriterion>(kept_with: C, more: C, less: C) {
    let finished = |criterion: C| {
        let mut driver = Driver::new(Noise(Repeats::Samples), criterion, params()).unwrap();
        driver.run(|_, _| ()).unwrap();
        driver
    };
    let (before, kept_less) = (finished(kept_with), less.fingerprint());
    let bytes = kept(&before);
    let resume = |criterion: C| {
        let fresh = Driver::new(Noise(Repeats::Samples), criterion, params()).unwrap();
        fresh.resume("job", Checkpoint::read(&bytes[..]).unwrap())
    };
    let words = resume(less).map(drop).unwrap_err().to_string();
    assert!(words.contains(&kept_less), "{words}");
    let mut resumed = resume(more).unwrap();
    resumed.run(|_, _| ()).unwrap();
    let mut grown = 0;
    for (was, is) in before.session().stops().zip(resumed.session().stops()) {
        assert!(is.tile == was.tile && is.spp >= was.spp && is.reason.is_final(), "{was:?}, {is:?}");
        grown += usize::from(is.spp > was.spp);
    }
    assert!(grown > 0);
}

#[cfg(feature = "bundled-model")]
#[test]
fn a_finished_run_goes_on_where_more_is_asked_for() {
    let people = |share| Oracle::new(crate::Model::bundled(), crate::People::new(share).unwrap());
    goes_on_with(people(0.9), people(0.99), people(0.5));
    goes_on_with(FixedSpp(40), FixedSpp(100), FixedSpp(20));
}

/// What may be wrong with a source.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Habit {
    None,
    /// Its first batch of each tile is noisier.
    Learns,
    /// It returns the mean of all samples so far.
    Lies,
    /// Each pixel shares samples with those beside it.
    Filters,
}

struct Habitual(Habit);

impl ProgressiveSource for Habitual {
    fn info(&self) -> SourceInfo {
        SourceInfo::new("habitual", 96, 48).with_repeats(Repeats::Samples)
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let batch = |&Request { tile, first, spp, .. }: &Request| {
            let from = if self.0 == Habit::Lies { 0 } else { first };
            let noisy = if self.0 == Habit::Learns && first == 0 { 3.0 } else { 1.0 };
            let pixel = |x: usize, y: usize| {
                let sample = |n| noisefloor_testkit::Noise::keyed(&[(y * 128 + x) as u64, n]).uniform();
                let mean = (from..first + spp).map(sample).sum::<f64>() / (first + spp - from) as f64;
                0.3 + 0.5 * noisy * (mean - 0.5) + 0.003 * x as f64
            };
            let filtered = |i: usize| {
                let (x, y) = (tile.x + i % tile.width, tile.y + i / tile.width);
                match self.0 {
                    Habit::Filters => (pixel(x, y) + pixel(x + 1, y) + pixel(x + 2, y)) / 3.0,
                    _ => pixel(x, y),
                }
            };
            Batch { tile, spp, mean: (0..tile.pixels()).map(|i| [filtered(i) as f32; 3]).collect() }
        };
        Ok(requests.iter().map(batch).collect())
    }
}

/// Runs up to so many batches; what it says at the end, if that is wrong.
fn run_for<S: ProgressiveSource, C: StoppingCriterion>(
    driver: &mut Driver<S, C>,
    batches: usize,
) -> Option<String> {
    let (cancel, mut left) = (driver.cancel_flag(), batches);
    let outcome = driver.run(|_, event| {
        if matches!(event, Event::BatchDone(_)) {
            left = left.saturating_sub(1);
            cancel.store(left == 0, Ordering::Relaxed);
        }
    });
    outcome.err().map(|error| error.to_string())
}

/// For every batch k, a checkpoint at k equals none: samples, stops, warnings and faults.
fn a_checkpoint_equals_none<C: StoppingCriterion>(criterion: impl Fn() -> C, habit: Habit) -> Vec<String> {
    let params = Params { tile: 16, max_spp: 96, ..Params::default() };
    let new = || Driver::new(Habitual(habit), criterion(), params.clone()).unwrap();
    let mut whole = new();
    let outcome = run_for(&mut whole, usize::MAX);
    let said: Vec<String> =
        whole.session().warnings().iter().map(ToString::to_string).chain(outcome.clone()).collect();
    for k in 1..whole.timeline().len() {
        let mut first = new();
        assert_eq!(run_for(&mut first, k), None);
        let checkpoint = kept(&first);
        let mut resumed = new().resume("job", Checkpoint::read(&checkpoint[..]).unwrap()).unwrap();
        assert_eq!(run_for(&mut resumed, usize::MAX), outcome, "{habit:?}, batch {k}");
        assert_eq!(resumed.session().warnings(), whole.session().warnings(), "{habit:?}, batch {k}");
        assert!(kept(&resumed) == kept(&whole), "{habit:?}, batch {k}");
    }
    said
}

/// With halves and without, and whatever is said meanwhile.
#[cfg(feature = "bundled-model")]
#[test]
fn at_every_batch_a_checkpoint_equals_none() {
    let habits = [
        (Habit::None, ""),
        (Habit::Learns, "differ in noise"),
        (Habit::Lies, "contain the samples of the ones before"),
        (Habit::Filters, "neighbouring pixels"),
    ];
    for (habit, noticed) in habits {
        a_checkpoint_equals_none(|| FixedSpp(96), habit);
        let said = a_checkpoint_equals_none(Oracle::bundled, habit);
        assert_eq!(said.is_empty(), habit == Habit::None, "{said:?}");
        assert!(said.last().is_none_or(|text| text.contains(noticed)), "{said:?}");
    }
}

/// A session that was told that pixels share samples need not be told again.
#[test]
fn shared_pixels_are_kept() {
    use crate::source::PixelNoise;
    let resumed = |kept: PixelNoise, now: PixelNoise| {
        let [mut one, mut other] =
            [0; 2].map(|_| crate::Session::new(96, 48, FixedSpp(40), params()).unwrap());
        one.set_pixels(kept);
        other.set_pixels(now);
        other.resume("job", one.checkpoint("job").unwrap()).unwrap().pixels()
    };
    use PixelNoise::{Independent, Shared};
    assert_eq!(resumed(Independent, Independent), Independent);
    assert_eq!([resumed(Shared, Independent), resumed(Independent, Shared)], [Shared; 2]);
}

#[cfg(feature = "bundled-model")]
#[test]
fn an_oracle_takes_up_no_nonsense() {
    let driver = broken_off(Oracle::bundled(), 3);
    let grid = driver.session().film().grid();
    let state = driver.session().criterion().state().unwrap();
    let mut oracle = Oracle::bundled();
    assert!(oracle.restore(grid, &state) && oracle.state().as_ref() == Some(&state));
    assert!(!oracle.restore(crate::TileGrid::new(16, 16, 16).unwrap(), &state));
    assert!(!oracle.restore(grid, &state[..state.len() - 1]) && !oracle.restore(grid, &[0xff; 64]));
    assert!(oracle.state() == Some(state));
}

#[test]
fn what_is_done_stays_done() {
    let bytes = kept(&broken_off(FixedSpp(40), usize::MAX));
    let driver = Driver::new(Noise(Repeats::Samples), FixedSpp(40), params()).unwrap();
    let driver = driver.resume("job", Checkpoint::read(&bytes[..]).unwrap()).unwrap();
    assert!(driver.session().is_done());
}

#[cfg(feature = "bundled-model")]
#[test]
fn another_job_is_refused() {
    let bytes = kept(&broken_off(FixedSpp(40), 1));
    let refused = |repeats, samples, params, job| {
        let driver = Driver::new(Noise(repeats), FixedSpp(samples), params).unwrap();
        driver.resume(job, Checkpoint::read(&bytes[..]).unwrap()).err().map(|e| e.to_string())
    };
    let other = |what: &str| format!("the checkpoint belongs to another job: its {what}");
    let begins = |error: Option<String>, with: &str| {
        let error = error.unwrap();
        assert!(error.starts_with(with), "{error}");
    };
    assert_eq!(refused(Repeats::Samples, 40, params(), "job"), None);
    begins(refused(Repeats::Samples, 40, params(), "silence"), &other("job"));
    begins(refused(Repeats::Samples, 30, params(), "job"), &other("criterion"));
    begins(
        refused(Repeats::Samples, 40, Params { consecutive: 2, ..params() }, "job"),
        &other("number of verdicts in a row is 1, not 2"),
    );
    let other_model = {
        let driver = broken_off(Oracle::bundled(), 1);
        let checkpoint = Checkpoint::read(&kept(&driver)[..]).unwrap();
        let laxer = Oracle::new(crate::Model::bundled(), crate::People::new(0.9).unwrap());
        let driver = Driver::new(Noise(Repeats::Samples), laxer, params()).unwrap();
        driver.resume("job", checkpoint).err().map(|e| e.to_string())
    };
    begins(other_model, &other("criterion"));
    begins(refused(Repeats::Calls, 40, params(), "job"), "noise cannot be resumed");
}

/// A curve of the caller's own is not in the checkpoint; the program that resumes has it.
#[test]
fn a_tone_curve_is_resumed_with_its_function() {
    use crate::{
        ToneMapping,
        display::{Display, ToneCurve},
    };
    let root = ToneCurve::new(b"root", |exposed| exposed.map(f32::sqrt));
    let params = |curve| Params { tone_mapping: ToneMapping::Custom { exposure: 1.0, curve }, ..params() };
    let resume = |made: Params, shown: Option<Display>, with: Params| {
        let mut driver = Driver::new(Noise(Repeats::Samples), FixedSpp(40), made).unwrap();
        shown.into_iter().for_each(|display| driver.session_mut().set_display(display).unwrap());
        let bytes = kept(&driver);
        let driver = Driver::new(Noise(Repeats::Samples), FixedSpp(40), with).unwrap();
        driver.resume("job", Checkpoint::read(&bytes[..]).unwrap())
    };
    let resumed = resume(params(root.clone()), None, params(root.clone())).unwrap();
    assert_eq!(resumed.session().display().unwrap().encode([0.25; 3]), [0.5; 3]);
    let other = ToneCurve::new(b"another root", |exposed| exposed.map(f32::sqrt));
    let refused = resume(params(root.clone()), None, params(other.clone()));
    assert!(matches!(refused, Err(CheckpointError::Other { what: "tone mapping", .. })));
    let own = ToneMapping::Custom { exposure: 1.0, curve: other }.settle(&[]);
    let resumed = resume(params(root.clone()), Some(own.clone()), params(root)).unwrap();
    assert_eq!(resumed.session().display(), Some(&own));
}

/// A source says what it is made from; its session keeps that, and does not resume after a change.
#[test]
fn another_source_is_refused() {
    let driver = broken_off(FixedSpp(40), 1);
    let resumed = |source: &str, contents: &[u8]| {
        let mut now = crate::source::SourceIdentity::new(source);
        now.add("hall.xml", contents);
        let mut kept = crate::source::SourceIdentity::new("noise");
        kept.add("hall.xml", b"lamps");
        let mut checkpoint = driver.session().checkpoint("job").unwrap();
        checkpoint.source = Cow::Owned(kept);
        let mut session = crate::Session::new(96, 48, FixedSpp(40), params()).unwrap();
        session.set_source(now);
        session.resume("job", checkpoint).map(drop).map_err(|e| e.to_string())
    };
    assert_eq!(resumed("noise", b"lamps"), Ok(()));
    let error = |what: &str| Err(format!("the checkpoint belongs to another job: {what}"));
    assert_eq!(resumed("noise", b"sun"), error("`hall.xml` has changed"));
    assert_eq!(resumed("hum", b"lamps"), error("it is of noise, not of hum"));
}

#[test]
fn what_does_not_hold_together_is_refused() {
    let driver = broken_off(FixedSpp(40), 1);
    let refused = |change: &dyn Fn(&mut Checkpoint<'_>)| {
        let mut checkpoint = driver.session().checkpoint("job").unwrap();
        change(&mut checkpoint);
        let driver = Driver::new(Noise(Repeats::Samples), FixedSpp(40), params()).unwrap();
        matches!(driver.resume("job", checkpoint), Err(CheckpointError::Invalid(_)))
    };
    assert!(!refused(&|_| ()));
    assert!(refused(&|c| c.tiles.to_mut().truncate(3)));
    for goal in [
        Goal::Verdict { spp: 40, streak: u32::MAX },
        Goal::Verdict { spp: u64::MAX, streak: 0 },
        Goal::Audience { spp: u64::MAX },
    ] {
        assert!(refused(&|c| c.tiles.to_mut()[0].goal = goal));
    }
    assert!(refused(&|c| c.tiles.to_mut().swap(0, 1)));
    assert!(refused(&|c| c.display = Some(Display::corrupt())));
    for (samples, error) in [(1, f64::NAN), (u64::MAX, 0.0)] {
        assert!(refused(&|c| c.settling = Some(Settling { samples, error })));
    }
    assert!(refused(&|c| c.state = vec![1, 2, 3]));
    assert!(refused(&|c| c.watch = Cow::Owned(Watch::new(crate::TileGrid::new(96, 48, 32).unwrap()))));
    assert!(refused(&|c| c.watch.to_mut().corrupt()));
    assert!(refused(&|c| c.film.to_mut().corrupt(0)));
    assert!(refused(&|c| c.film.to_mut().corrupt(1)));
    assert!(refused(&|c| c.film.to_mut().corrupt(2)));
    assert!(refused(&|c| c.film.to_mut().corrupt(3)));
    assert!(refused(&|c| c.film.to_mut().corrupt(4)));
}

proptest! {
    /// Damage is found by the checksum; what a checksum was made for that is nonsense, by what reads it.
    #[test]
    fn damage_and_nonsense_are_errors(at in 0usize..10_000, bit in 0u8..8, nonsense in prop::collection::vec(any::<u8>(), 0..200)) {
        let mut bytes = kept(&broken_off(FixedSpp(40), 1));
        let at = at % bytes.len();
        bytes[at] ^= 1 << bit;
        prop_assert!(Checkpoint::read(&bytes[..]).is_err());
        prop_assert!(Checkpoint::read(&bytes[..at]).is_err());
        let mut file = Vec::new();
        FORMAT.write(&nonsense, &mut file).unwrap_or_default();
        prop_assert!(Checkpoint::read(&file[..]).is_err());
    }
}

/// A head may announce any film: memory is taken for what follows it only.
#[test]
fn a_film_is_believed_as_far_as_it_comes() {
    let driver = broken_off(FixedSpp(40), 1);
    let mut checkpoint = driver.session().checkpoint("job").unwrap();
    let mut file = Vec::new();
    checkpoint.film = Cow::Owned(Film::new(crate::TileGrid::new(96, 48, 16).unwrap()));
    checkpoint.write(&mut file).unwrap();
    assert_eq!(file.len() - 32 - 96 * 48 * 36, head(&file), "18 bytes per pixel of each half");
    for left in [head(&file), head(&file) + 1000, file.len() - 1] {
        let error = Checkpoint::read(&file[..left]).unwrap_err();
        assert!(matches!(error, CheckpointError::Damaged(_)), "{left}: {error}");
    }
    let mut long = file.clone();
    long.push(0);
    assert!(matches!(Checkpoint::read(&long[..]), Err(CheckpointError::Damaged(_))));

    // The largest picture there may be, 2²⁸ pixels, in a file of a few hundred bytes
    let vast = crate::TileGrid::new(1 << 14, 1 << 14, 512).unwrap();
    let film = FilmHead::announcing(vast);
    let mut nothing: &[u8] = &[];
    assert!(Film::read_pixels(film, &mut nothing).is_err());
}

/// Bytes before the pixels.
fn head(file: &[u8]) -> usize {
    52 + u64::from_le_bytes(file[12..20].try_into().unwrap()) as usize
}

#[test]
fn a_criterion_that_keeps_its_state_to_itself_is_not_resumed() {
    let whim = || judging_each(Needs::default(), |_, _| Verdict::default());
    let driver = broken_off(whim(), 1);
    let said = driver.session().checkpoint("job").unwrap_err().to_string();
    assert!(said.contains("a whim cannot be resumed"), "{said}");
    assert!(!whim().restore(driver.session().film().grid(), &[]));
}
