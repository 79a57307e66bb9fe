//! What observers said of one zone, and where its images are.

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
    pub scene: String,
    pub renderer: String,
    /// Row-major number of the zone in the scene.
    pub zone: u32,
    /// Left edge in the full picture, in pixels.
    pub x: usize,
    /// Top edge in the full picture, in pixels.
    pub y: usize,
    pub width: usize,
    pub height: usize,
    /// Mean samples per pixel at which observers could no longer tell the zone from the reference; positive.
    pub human_spp: f64,
    /// Whether `human_spp` is only a lower bound: it is at least 10,000, or at least `last_spp`.
    /// Keep it out of means.
    pub censored: bool,
    /// Samples per pixel of the least converged image observers could choose.
    pub first_spp: u64,
    /// Samples per pixel of the most converged image observers could choose. Not all images up to it need be
    /// here.
    pub last_spp: u64,
    /// Samples per pixel of the picture that people compared with, if it contains those of the pictures they judged;
    /// infinite if it had no noise. See [`crate::as_noise`].
    pub reference_spp: f64,
    pub stack: ZoneImages,
}
