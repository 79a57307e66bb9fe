//! What observers said of one zone, and where its images are.

use super::table::ThresholdRow;
use std::path::PathBuf;

/// A threshold at or above this many samples per pixel is censored: observers were offered no more.
pub(crate) const CENSORED_SPP: f64 = 10_000.0;

/// Where the images of a zone are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ZoneImages {
    /// A folder of running means of the whole scene, shared by all its zones.
    RunningMeans(PathBuf),
    /// A folder of batch means of only this zone.
    Batches(PathBuf),
}

/// One zone of a scene, and the threshold observers gave for it.
#[derive(Clone, Debug, PartialEq)]
pub struct JudgedZone {
    /// As the table has it.
    pub row: ThresholdRow,
    pub stack: ZoneImages,
}

impl JudgedZone {
    /// Whether the threshold is only a lower bound: it is at least 10,000, or at least `last_spp`. Keep it out of means.
    pub fn censored(&self) -> bool {
        self.row.human_spp >= CENSORED_SPP || self.row.human_spp >= self.row.last_spp as f64
    }

    /// Samples per pixel of the picture that people compared with, if it contains those of the pictures they judged;
    /// infinite if it had no noise. See [`crate::as_noise`].
    pub fn reference_spp(&self) -> f64 {
        let nested = matches!(self.stack, ZoneImages::RunningMeans(_));
        self.row.reference_spp.unwrap_or(if nested { self.row.last_spp as f64 } else { f64::INFINITY })
    }
}
