//! Pictures in, maps of differences out.

use noisefloor::{Rgb, tile::TileError, tile::check_image};
use noisefloor_vision::VisionError;
use std::ops::RangeInclusive;
use thiserror::Error;

/// Sensible pixels per degree: the filters of a metric grow with them.
pub(crate) const RESOLUTIONS: RangeInclusive<f64> = 1.0..=1000.0;

#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum MetricError {
    #[error(transparent)]
    Size(#[from] TileError),
    #[error("a picture of {width}×{height} pixels needs {expected} values, not {got}")]
    Pixels { width: usize, height: usize, expected: usize, got: usize },
    #[error("pictures of {0:?} and {1:?} pixels (width, height) cannot be compared; use the same size")]
    Differ((usize, usize), (usize, usize)),
    #[error("{metric} needs pictures of at least {least}×{least} pixels, not {width}×{height}")]
    Small { metric: &'static str, least: usize, width: usize, height: usize },
    #[error("{metric} refused the pictures: {why}")]
    Refused { metric: &'static str, why: String },
    #[error(
        "pixel ({x}, {y}) of the {picture} is not finite; repair the render or paint over the pixel first"
    )]
    NotFinite {
        /// `"picture"` or `"reference"`.
        picture: &'static str,
        x: usize,
        y: usize,
    },
    #[error("ColorVideoVDP: {0}")]
    Vision(#[from] VisionError),
    #[error(
        "the resolution must be {least} to {most} pixels per degree of the visual field, not {0}",
        least = RESOLUTIONS.start(),
        most = RESOLUTIONS.end()
    )]
    Resolution(f64),
}

/// The pixels of a display-encoded picture, borrowed: sRGB values in [0, 1], row-major. Metrics clamp values
/// outside, and take NaN for black.
#[derive(Clone, Copy, Debug)]
pub struct DisplayPixels<'a> {
    width: usize,
    height: usize,
    pixels: &'a [Rgb],
}

impl<'a> DisplayPixels<'a> {
    /// A picture of `width`×`height` pixels.
    pub fn new(width: usize, height: usize, pixels: &'a [Rgb]) -> Result<Self, MetricError> {
        check_image(width, height)?;
        let expected = width * height;
        if pixels.len() != expected {
            return Err(MetricError::Pixels { width, height, expected, got: pixels.len() });
        }
        Ok(Self { width, height, pixels })
    }

    pub fn width(&self) -> usize {
        self.width
    }

    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels, row-major.
    pub fn pixels(&self) -> &'a [Rgb] {
        self.pixels
    }

    pub(crate) fn check_pair(&self, other: &Self) -> Result<(), MetricError> {
        let (a, b) = ((self.width, self.height), (other.width, other.height));
        if a == b { Ok(()) } else { Err(MetricError::Differ(a, b)) }
    }
}

/// How visible a difference is at each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct DifferenceMap {
    pub width: usize,
    pub height: usize,
    /// Row-major, `width * height` values, at least one; their meaning is that of the metric.
    pub values: Vec<f32>,
}

impl DifferenceMap {
    pub fn mean(&self) -> f64 {
        self.values.iter().map(|&v| f64::from(v)).sum::<f64>() / self.values.len() as f64
    }

    pub fn max(&self) -> f64 {
        self.values.iter().copied().fold(f32::NEG_INFINITY, f32::max).into()
    }

    /// (mean of |v|ᵖ)^(1/p), for p > 0.
    pub fn norm(&self, p: f64) -> f64 {
        let sum: f64 = self.values.iter().map(|&v| f64::from(v.abs()).powf(p)).sum();
        (sum / self.values.len() as f64).powf(1.0 / p)
    }
}
