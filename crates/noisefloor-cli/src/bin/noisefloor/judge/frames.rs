//! The frames of a sequence, each with its worst place.

use super::report::{Judged, Place};
use anyhow::Context;
use noisefloor_cli::say::{say, say_json};
use noisefloor_farm::Frames;
use serde::Serialize;

#[derive(Serialize)]
struct Row {
    frame: i32,
    #[serde(flatten)]
    judged: Judged,
}

/// Judges all frames, and says what each is like; whether all have converged.
pub(super) fn run(
    frames: &Frames,
    value: &str,
    json: bool,
    judge: impl Fn(i32) -> anyhow::Result<Judged>,
) -> anyhow::Result<bool> {
    let mut rows = Vec::new();
    if !json {
        say!("frame  converged    worst place      size  {value}")?;
    }
    for frame in frames.iter() {
        let judged = judge(frame).with_context(|| format!("frame {frame}"))?;
        if let (false, Some(Place { x, y, width, height, probability, jods_lost })) = (json, judged.worst) {
            let (size, place) = (format!("{width}×{height}"), format!("({x}, {y})"));
            let value = jods_lost.or(probability.map(f64::from)).unwrap_or_default();
            let converged = format!("{} of {}", judged.converged_tiles, judged.tiles);
            say!("{frame:5} {converged:>10} {place:>14} {size:>9}  {value:.3}")?;
        }
        rows.push(Row { frame, judged });
    }
    if json {
        say_json(&rows)?;
    }
    Ok(rows.iter().all(|row| row.judged.is_converged()))
}
