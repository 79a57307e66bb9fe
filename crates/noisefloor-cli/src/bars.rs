//! Progress bars.

use indicatif::{ProgressBar, ProgressStyle};
#[cfg(feature = "lab")]
use noisefloor_lab::Advance;
#[cfg(feature = "lab")]
use std::sync::Mutex;

/// A bar with an estimate of the time left.
pub fn bar(len: u64, what: &'static str) -> ProgressBar {
    let style =
        ProgressStyle::with_template("{bar:32} {pos}/{len} {prefix}  {elapsed_precise}, {eta} to go  {msg}");
    let bar = ProgressBar::new(len).with_prefix(what);
    style.map(|style| bar.clone().with_style(style)).unwrap_or(bar)
}

/// One bar after another, as work advances.
#[cfg(feature = "lab")]
pub struct Bars {
    quiet: bool,
    now: Mutex<Option<(&'static str, ProgressBar)>>,
}

#[cfg(feature = "lab")]
impl Bars {
    pub fn new(quiet: bool) -> Self {
        Self { quiet, now: Mutex::new(None) }
    }

    pub fn show(&self, Advance { what, done, of, detail }: Advance<'_>) {
        let Ok(mut now) = self.now.lock() else { return };
        if self.quiet {
            return;
        }
        if now.as_ref().is_none_or(|(of, _)| *of != what) {
            if let Some((_, old)) = now.take() {
                old.finish_and_clear();
            }
            *now = Some((what, bar(of, what)));
        }
        if let Some((_, bar)) = now.as_ref() {
            bar.set_length(of);
            bar.set_position(done);
            bar.set_message(detail.to_owned());
        }
    }

    /// Takes the last one away.
    pub fn finish(&self) {
        if let Some((_, bar)) = self.now.lock().ok().and_then(|mut now| now.take()) {
            bar.finish_and_clear();
        }
    }
}
