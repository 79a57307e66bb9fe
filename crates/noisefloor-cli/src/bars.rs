//! Progress: bars in a terminal, lines in a log.

use crate::say::note;
use indicatif::{ProgressBar, ProgressStyle};
#[cfg(feature = "lab")]
use noisefloor_lab::Advance;
use std::io::{self, IsTerminal};
#[cfg(feature = "lab")]
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Pause between two lines of a log.
const LINES: Duration = Duration::from_secs(30);

/// Where standard error is not a terminal, which shows a bar, a line now and then.
pub struct Log {
    next: Option<Instant>,
}

impl Log {
    pub fn new(quiet: bool) -> Self {
        let wanted = !quiet && !io::stderr().is_terminal();
        Self { next: wanted.then(|| Instant::now() + LINES) }
    }

    pub fn tell(&mut self, line: impl FnOnce() -> String) {
        if self.next.is_some_and(|next| Instant::now() >= next) {
            note!("{}", line());
            self.next = Some(Instant::now() + LINES);
        }
    }
}

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
    log: Mutex<Log>,
}

#[cfg(feature = "lab")]
impl Bars {
    pub fn new(quiet: bool) -> Self {
        Self { quiet, now: Mutex::new(None), log: Mutex::new(Log::new(quiet)) }
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
            if let Ok(mut log) = self.log.lock() {
                let (gone, left) = (bar.elapsed().as_secs(), bar.eta().as_secs());
                log.tell(|| format!("{done}/{of} {what} after {gone} s, about {left} s to go {detail}"));
            }
        }
    }

    /// Takes the last one away.
    pub fn finish(&self) {
        if let Some((_, bar)) = self.now.lock().ok().and_then(|mut now| now.take()) {
            bar.finish_and_clear();
        }
    }
}
