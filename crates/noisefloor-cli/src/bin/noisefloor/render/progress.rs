//! The progress of a render.

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use noisefloor::{Session, driver::Progress};
use noisefloor_cli::bars::{self, Log};
use std::time::Duration;

pub fn reference_bar(quiet: bool) -> ProgressBar {
    if quiet { ProgressBar::hidden() } else { bars::bar(0, "blocks of the reference") }
}

pub(super) fn bar(quiet: bool) -> ProgressBar {
    let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let style = ProgressStyle::with_template("{bar:20} {pos}/{len} tiles done, {elapsed}, {msg}");
    let bar = ProgressBar::with_draw_target(Some(0), target);
    style.map(|style| bar.clone().with_style(style)).unwrap_or(bar)
}

pub(super) fn show(bar: &ProgressBar, log: &mut Log, session: &Session, progress: &Progress) {
    let pixels = (session.film().grid().width() * session.film().grid().height()) as f64;
    let eta = match progress.eta_seconds {
        Some(seconds) => {
            let left = Duration::from_secs(seconds.clamp(0.0, 1e9) as u64);
            format!("about {} to go", HumanDuration(left))
        }
        None => "no estimate yet".into(),
    };
    let (done, tiles) = (progress.tiles - progress.now.active_tiles, progress.tiles);
    let message = format!("{:.1} spp, {eta}", progress.now.samples as f64 / pixels);
    log.tell(|| format!("{done}/{tiles} tiles done after {:.0} s, {message}", progress.now.seconds));
    bar.set_length(tiles as u64);
    bar.set_position(done as u64);
    bar.set_message(message);
}
