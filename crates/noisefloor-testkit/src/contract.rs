//! The contract of a source of samples.

mod distribution;
mod exact;
mod first_hits;
mod independence;
mod probe;
mod reference;
mod rounding;
mod silence;

pub use reference::check_reference;
pub use silence::check_silence;

use distribution::{LONG, check_distribution};
use exact::{all_have, check_aiming, check_cut, same};
use first_hits::check_first_hits;
use independence::check_independence;
use noisefloor::{Counts, ProgressiveSource, Repeats, source::PixelNoise};
use probe::{Round, Subject};
use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe, catch_unwind};
use std::sync::Once;

/// Rounds of 16 samples that are compared for independence.
const ROUNDS: usize = 4;
/// The same where pixels share samples: each tile of a batch then gives one term.
const ROUNDS_OF_TILES: usize = 64;
/// Batches within which a playback that ends is seen to end.
const MOST_OF_A_PLAYBACK: usize = 1000;
/// Batches within which a renderer that ends is seen to end. Few renderers do.
const MOST_OF_A_RENDERER: usize = 8;

/// Checks everything that a [`ProgressiveSource`] promises.
///
/// `make` makes a new source each time it is called, always the same one: the same scene, the same seed. The
/// image needs more than one tile of 32×32 pixels and edges that are no multiples of 32: 48×40 pixels are
/// enough, and quick. A few dozen noisy pixels are enough to find a correlation. The crate's front page has
/// an example.
///
/// # What is checked
/// - **The description** is in range, does not change with use, and is the same for every source that `make`
///   makes.
/// - **The shape of an answer**: one batch a request, in the order of the requests, for the tile asked for,
///   with a value for each pixel. An empty list of requests gives an empty list of batches.
/// - **Numbers of samples** are as [`SourceInfo::counts`](noisefloor::SourceInfo::counts) says: those asked
///   for until the source ends, or more within bounds, or what a playback has, whatever is asked for.
/// - **What [`SourceInfo::repeats`](noisefloor::SourceInfo::repeats) promises.** [`Repeats::Calls`]: sources
///   of the same construction give the same samples to the bit. [`Repeats::Samples`]: in addition, 8 and then
///   24 samples are, but for rounding, the 32 samples asked for at once; and a tile gets the same samples
///   when it is asked for alone or at another depth than its neighbours.
/// - **The distribution** does not depend on how requests are cut: 12 batches of 32 samples against 12 of 8 +
///   8 + 8 + 8.
/// - **Independence**: new samples are independent of those before, in the same tile and in others.
/// - **Pixels**: the noise of neighbours is independent, unless
///   [`SourceInfo::pixels`](noisefloor::SourceInfo::pixels) says that they share samples.
/// - **First hits**, if there are any, have the image's size, albedo in [0, 1] and normals no longer than 1.
///   Those of different indices are independent, or have no noise at all, and rendering them changes no
///   sample.
/// - **The end.** At its end a source gives empty batches, however often it is asked.
///
/// A playback is asked for neither parts of a batch nor single tiles at other depths.
///
/// # How often a correct source fails by chance
/// The sources of this project are seeded wherever their renderers are, so that they always pass or always
/// fail.
///
/// *Independence:* p < 1.9e-7 a source. The noise of a pixel is the difference x of two batches of equal
/// size, which is symmetric around 0, and so is the difference y of two others. Given all |xy|, only their
/// signs are left to chance, and those are independent from pixel to pixel. Then z = Σxy/√Σ(xy)² exceeds 6
/// with p ≤ 2·exp(−6²/2) = 3.1e-8, whatever the distribution (Hoeffding 1963). There are six such z, and
/// three more of first hits, where there are any: p < 2.8e-7 then. The batches of a playback differ in size;
/// for them this holds as far as z is normal. Where pixels share samples, the signs are those of whole tiles, in
/// 64 batches instead of 4.
///
/// *Distribution:* p < 1e-7 a source. The mean of a batch over its pixels, and the mean square of its
/// deviations (in units of each pixel's standard deviation over all batches), are compared by Welch's t
/// (1947) at p = 1e-8, two-sided. Where pixels are independent, so are the
/// ranks that the 12 long batches have among all 24 in each pixel. Their 23 cumulative frequencies (the
/// Kolmogorov–Smirnov comparison, pixel by pixel) are each off by 6 standard errors with p < 2e-9, by the
/// normal approximation.
///
/// # Panics
/// If a promise is not kept. The message says which.
pub fn check_source<S: ProgressiveSource>(make: impl Fn() -> S) {
    let subject = Subject::new(make);
    let playback = subject.info.counts == Counts::Stored;
    let per_pixel = subject.info.pixels == PixelNoise::Independent;
    let rounds = subject.rounds(&vec![16; if per_pixel { ROUNDS } else { ROUNDS_OF_TILES }]);
    let four = &rounds[..4];

    let whole = if playback {
        let other = subject.rounds(&[1, 1000, 5, 7]);
        assert!(same(four, &other), "a playback gave other batches because other numbers were asked for");
        None
    } else {
        Some(subject.rounds(&[32]).remove(0))
    };
    if subject.promises(Repeats::Calls) {
        let again = subject.rounds(&[16; 4]);
        assert!(same(four, &again), "the same construction gave other samples the second time");
    }
    if let Some(whole) = &whole {
        check_parts(&subject, whole);
    }
    if subject.info.aims {
        check_aiming(subject.start(), four, subject.promises(Repeats::Samples));
    }
    check_independence(&rounds, whole.as_ref(), subject.info.pixels);
    if !playback {
        check_cuts(&subject);
    }
    check_first_hits_change_nothing(&subject, four);
    check_end(&subject, if playback { MOST_OF_A_PLAYBACK } else { MOST_OF_A_RENDERER });
}

thread_local! {
    /// Whether a panic of this thread is an answer, which is not reported.
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Catches a panic that is reported nowhere. Panics of other threads, and later ones of this, are reported as
/// before.
fn quietly(work: impl FnOnce()) -> std::thread::Result<()> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let report = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !QUIET.get() {
                report(info);
            }
        }));
    });
    QUIET.set(true);
    let outcome = catch_unwind(AssertUnwindSafe(work));
    QUIET.set(false);
    outcome
}

/// What [`check_source`] finds wrong with a source, in place of a panic: for other languages. Nothing goes
/// where panics are reported.
pub fn broken_promise<S: ProgressiveSource>(make: impl Fn() -> S) -> Option<String> {
    let panic = quietly(|| check_source(make)).err()?;
    let text = panic.downcast_ref::<String>().cloned();
    let text = text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()));
    Some(text.unwrap_or_else(|| "the check failed without words".into()))
}

/// How requests are cut changes no sample.
fn check_parts<S: ProgressiveSource>(subject: &Subject<impl Fn() -> S>, whole: &Round) {
    let parts = subject.rounds(&[8, 24]);
    if subject.promises(Repeats::Samples) && all_have(&parts[1], 24) {
        check_cut(whole, &parts);
    }
}

/// How requests are cut does not change the distribution.
fn check_cuts<S: ProgressiveSource>(subject: &Subject<impl Fn() -> S>) {
    let mut probe = subject.start();
    let long: Vec<Round> = (0..LONG).map(|_| probe.ask_all(32)).collect();
    let short: Vec<Round> = (0..4 * LONG).map(|_| probe.ask_all(8)).collect();
    if !all_have(&short[4 * LONG - 1], 0) {
        check_distribution(&long, &short, subject.info.pixels);
    }
}

/// First hits are rendered for nobody's samples.
fn check_first_hits_change_nothing<S: ProgressiveSource>(subject: &Subject<impl Fn() -> S>, four: &[Round]) {
    let mut probe = subject.start();
    check_first_hits(&mut probe.source, &subject.info);
    let after = [probe.ask_all(16)];
    if subject.promises(Repeats::Calls) {
        assert!(same(&after, &four[..1]), "rendering first hits changed the samples");
    }
}

/// A source that has ended does not begin again.
fn check_end<S: ProgressiveSource>(subject: &Subject<impl Fn() -> S>, most: usize) {
    let mut probe = subject.start();
    if (0..most).any(|_| all_have(&probe.ask_all(16), 0)) {
        assert!(all_have(&probe.ask_all(16), 0), "after its end the source has samples again");
    }
}
