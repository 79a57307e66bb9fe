//! `render --frames --forecast`: what the whole sequence takes, by some of its frames.

use super::frame_report::FrameRow;
use indicatif::FormattedDuration;
use noisefloor_cli::files::write_json;
use noisefloor_cli::say;
use noisefloor_farm::{Forecast, Frames};
use serde::Serialize;
use std::path::Path;
use std::time::Duration;

const FILE: &str = "forecast.json";

#[derive(Serialize)]
struct Forecasts<'a> {
    /// All frames, as they are typed.
    frames: &'a Frames,
    /// Those that it is made of; frames.csv says what they took.
    known: Vec<i32>,
    /// Samples per pixel, on average over all pixels of all frames.
    spp: Span,
    /// Of all frames together, one after another on this machine.
    seconds: Span,
}

/// What is expected, and where nine of ten sequences are.
#[derive(Serialize)]
struct Span {
    expected: f64,
    low: f64,
    high: f64,
}

impl Span {
    /// That share of a sum over all frames.
    fn of(sum: Forecast, share: f64) -> Self {
        Self { expected: share * sum.total, low: share * sum.low, high: share * sum.high }
    }
}

/// Writes what the sequence will take, and says it.
pub(super) fn say(frames: &Frames, out: &Path, rows: &[FrameRow], quiet: bool) -> anyhow::Result<()> {
    let forecast = |value: fn(&FrameRow) -> f64| {
        let known: Vec<_> = rows.iter().map(|row| (row.frame, value(row))).collect();
        Forecast::of(frames, &known)
    };
    let sums = forecast(|row| row.spp).zip(forecast(|row| row.seconds));
    let (spp, seconds) =
        sums.ok_or_else(|| anyhow::anyhow!("too few frames were rendered for a forecast"))?;
    let known: Vec<i32> = rows.iter().map(|row| row.frame).collect();
    let (spp, seconds) = (Span::of(spp, 1.0 / frames.count() as f64), Span::of(seconds, 1.0));
    let forecasts = Forecasts { frames, known, spp, seconds };
    write_json(&out.join(FILE), &forecasts)?;
    if quiet {
        return Ok(());
    }
    say!("   frame       spp    seconds")?;
    for FrameRow { frame, spp, seconds, .. } in rows {
        say!("{frame:8} {spp:9.1} {seconds:10.1}")?;
    }
    let Forecasts { spp, seconds, .. } = &forecasts;
    say!(
        "all {} frames: {:.0} samples per pixel on average; {:.0} to {:.0} in nine of ten sequences",
        frames.count(),
        spp.expected,
        spp.low,
        spp.high
    )?;
    let time = |seconds: f64| FormattedDuration(Duration::from_secs_f64(seconds.clamp(0.0, 1e12).round()));
    say!(
        "{} of rendering on this machine, one frame after another; {} to {}",
        time(seconds.expected),
        time(seconds.low),
        time(seconds.high)
    )?;
    say!(
        "written to {}: {FILE}, and these frames, from which --resume without --forecast goes on",
        out.display()
    )?;
    Ok(())
}
