//! When a render is saved: often enough that a kill loses little, rarely enough that saving costs little.

use crate::job::Autosave;
use std::time::{Duration, Instant};

/// Least pause of [`Autosave::Paced`].
const LEAST: Duration = Duration::from_secs(30);
/// Checkpoint and pictures may take a hundredth of the time each: a pause is 99 times as long as what comes
/// before it took.
const PAUSES: u32 = 99;
/// Nanoseconds that a pixel of a checkpoint and of all pictures take, until it is measured.
const CHECKPOINT: u64 = 80;
const PICTURES: u64 = 600;

/// How long the pictures of a render will take at its end.
pub(super) fn last_save(pixels: usize) -> Duration {
    Duration::from_nanos(PICTURES.saturating_mul(pixels as u64))
}

/// When something is saved, or shown, next.
pub(super) struct Pace {
    /// Least pause; none for never.
    least: Option<Duration>,
    /// Times that a pause is as long as what comes before it took.
    pauses: u32,
    next: Option<Instant>,
}

impl Pace {
    fn new(autosave: Autosave, expected: Duration) -> Self {
        let (least, pauses) = match autosave {
            Autosave::Never => (None, 0),
            Autosave::Every(pause) => (Some(pause), 0),
            Autosave::Paced => (Some(LEAST), PAUSES),
        };
        let mut pace = Self { least, pauses, next: None };
        pace.pause_after(expected);
        pace
    }

    /// For what people watch: at once, and then after this pause, or as soon as it takes 1 % of the time.
    pub(super) fn of_view(least: Duration) -> Self {
        Self { least: Some(least), pauses: PAUSES, next: Some(Instant::now()) }
    }

    /// For checkpoints, and for pictures, of a render of so many pixels.
    pub(super) fn both(autosave: Autosave, pixels: usize) -> [Self; 2] {
        let expected = |nanoseconds: u64| Duration::from_nanos(nanoseconds.saturating_mul(pixels as u64));
        [Self::new(autosave, expected(CHECKPOINT)), Self::new(autosave, expected(PICTURES))]
    }

    pub(super) fn is_due(&self) -> bool {
        self.next.is_some_and(|next| Instant::now() >= next)
    }

    /// Saving is over, and took this long.
    pub(super) fn pause_after(&mut self, took: Duration) {
        self.next = self.pause(took).and_then(|pause| Instant::now().checked_add(pause));
    }

    /// The pause after saving took this long.
    fn pause(&self, took: Duration) -> Option<Duration> {
        self.least.map(|least| least.max(took.saturating_mul(self.pauses)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pause_grows_with_what_saving_costs() {
        let pause = |autosave, took| {
            let pace = Pace::new(autosave, Duration::ZERO);
            pace.pause(Duration::from_millis(took)).map(|pause| pause.as_secs())
        };
        assert_eq!(pause(Autosave::Paced, 10), Some(30));
        assert_eq!(pause(Autosave::Paced, 1000), Some(99));
        assert_eq!(pause(Autosave::Every(Duration::from_secs(5)), 1000), Some(5));
        assert_eq!(pause(Autosave::Never, 10), None);
    }
}
