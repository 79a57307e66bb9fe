//! Progress of what advances in parts.

use indicatif::ProgressBar;
use noisefloor_cli::bars::Log;
pub use noisefloor_cli::bars::bar;
use noisefloor_lab::Advance;
use std::sync::Mutex;

/// One bar after another, as work advances.
pub struct Bars {
    quiet: bool,
    now: Mutex<Option<(&'static str, ProgressBar)>>,
    log: Mutex<Log>,
}

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
