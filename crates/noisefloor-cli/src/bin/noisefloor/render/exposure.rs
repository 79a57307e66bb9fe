//! The exposure of a sequence: of one frame, or eased between several.

use anyhow::{Context, bail};
use noisefloor_cli::files::write_json;
use noisefloor_cli::folder::Earlier;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::{BufReader, ErrorKind};
use std::path::Path;

/// Where frames have their exposure from, where it hangs on the picture.
#[derive(Clone, Debug, PartialEq)]
pub enum SequenceExposure {
    /// Each what it settles on, or all a given one.
    Each,
    /// From these frames, in ascending order; whether the user has named them.
    Of(Vec<i32>, bool),
}

/// One frame of exposure.json: what a sequence keeps, so that frames which are rendered later, or elsewhere,
/// have the same exposure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeyExposure {
    pub frame: i32,
    pub exposure: f32,
}

const KEPT: &str = "exposure.json";

/// The exposure of a frame by key frames in ascending order; none of a key frame, which settles its own, or
/// without any. Between two it changes by the same factor from frame to frame, as equal steps look equal;
/// outside it stays.
pub fn eased(keys: &[KeyExposure], frame: i32) -> Option<f32> {
    let next = keys.partition_point(|key| key.frame < frame);
    let before = next.checked_sub(1).map(|index| keys[index]);
    match (before, keys.get(next)) {
        (_, Some(key)) if key.frame == frame => None,
        (Some(before), Some(after)) => {
            let since = |frame: i32| f64::from(frame) - f64::from(before.frame);
            let way = since(frame) / since(after.frame);
            let [from, to] = [before, *after].map(|key| f64::from(key.exposure).ln());
            Some((from + way * (to - from)).exp() as f32)
        }
        (Some(one), None) | (None, Some(&one)) => Some(one.exposure),
        (None, None) => None,
    }
}

impl SequenceExposure {
    /// The frames whose exposures the others have.
    pub fn frames(&self) -> &[i32] {
        match self {
            Self::Each => &[],
            Self::Of(frames, _) => frames,
        }
    }

    /// What frames in the output folder have already.
    pub(super) fn kept(&self, out: &Path, earlier: Earlier) -> anyhow::Result<Vec<KeyExposure>> {
        let path = out.join(KEPT);
        let Self::Of(frames, typed) = self else { return Ok(Vec::new()) };
        if earlier == Earlier::Overwrite {
            return match fs::remove_file(&path) {
                Err(error) if error.kind() != ErrorKind::NotFound => {
                    Err(error).context(path.display().to_string())
                }
                _ => Ok(Vec::new()),
            };
        }
        let kept = read(out)?;
        if *typed && !kept.is_empty() && !kept.iter().map(|key| &key.frame).eq(frames) {
            let of: Vec<String> = kept.iter().map(|key| key.frame.to_string()).collect();
            bail!(
                "{} has the exposure of frame {}, which the frames that are there have: \
                 leave out --exposure-from, or render all frames again with --force",
                path.display(),
                of.join(", ")
            );
        }
        Ok(kept)
    }
}

/// Keeps the exposures of a sequence.
pub(super) fn keep(out: &Path, keys: &[KeyExposure]) -> anyhow::Result<()> {
    write_json(&out.join(KEPT), &keys)
}

/// What a folder keeps of the exposures of a sequence; nothing if it is none.
fn read(out: &Path) -> anyhow::Result<Vec<KeyExposure>> {
    let path = out.join(KEPT);
    let file = match File::open(&path) {
        Ok(file) => file,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error).context(path.display().to_string()),
    };
    serde_json::from_reader(BufReader::new(file)).with_context(|| path.display().to_string())
}

/// The exposure of the render in this folder, or of the sequence.
pub fn exposure_of(folder: &Path) -> anyhow::Result<f32> {
    let option = || format!("--exposure-from {}", folder.display());
    match read(folder).with_context(option)?.as_slice() {
        [] => {}
        [key] => return Ok(key.exposure),
        _ => bail!("{}: that sequence has several exposures; name the folder of one frame", option()),
    }
    let report = super::frame_report::read(folder);
    let report =
        report.with_context(option).context("no report.json of a render is there, or it is damaged")?;
    report
        .exposure
        .with_context(option)
        .context("that render has no exposure yet: let it come to its first verdict")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposures_are_eased_by_factors() {
        let keys = [(3, 1.0), (5, 4.0), (8, 0.5)].map(|(frame, exposure)| KeyExposure { frame, exposure });
        let exposure_at = |frame| eased(&keys, frame);
        assert_eq!(
            [1, 2, 3, 5, 8, 9, 100].map(exposure_at),
            [Some(1.0), Some(1.0), None, None, None, Some(0.5), Some(0.5)]
        );
        for (frame, exposure) in [(4, 2.0), (6, 2.0), (7, 1.0)] {
            assert!(
                exposure_at(frame).is_some_and(|found| (found - exposure).abs() < 1e-6),
                "{frame}: {:?}",
                exposure_at(frame)
            );
        }
        assert_eq!((eased(&keys[..1], 3), eased(&keys[..1], 7), eased(&[], 7)), (None, Some(1.0), None));
    }
}
