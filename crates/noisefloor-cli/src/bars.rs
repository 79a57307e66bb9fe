//! Progress: bars in a terminal, lines in a log.

use crate::say::note;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{self, IsTerminal};
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
