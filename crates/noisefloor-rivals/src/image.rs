//! Pictures in and maps out.

use noisefloor::{Rgb, TileError, check_image};
use std::ops::RangeInclusive;
use thiserror::Error;

/// Pixels per degree that make sense: the filters of a metric grow with them.
pub(crate) const RESOLUTIONS: RangeInclusive<f64> = 1.0..=1000.0;

/// A picture whose size and pixels do not go together.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum ImageError {
    /// The size is out of range.
    #[error(transparent)]
    Size(#[from] TileError),
    /// Another number of pixels than the size says.
    #[error("a picture of {width}×{height} pixels has {expected} of them, not {got}")]
    Pixels {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// Width × height.
        expected: usize,
        /// Pixels given.
        got: usize,
    },
    /// Two pictures that are to be compared have different sizes.
    #[error(
        "pictures of {0:?} and {1:?} pixels (width, height) cannot be compared: give two of the same size"
    )]
    Differ((usize, usize), (usize, usize)),
    /// Too small for a metric.
    #[error("{metric} needs pictures of at least {least}×{least} pixels, not {width}×{height}")]
    Small {
        /// The metric.
        metric: &'static str,
        /// Smallest edge.
        least: usize,
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// A metric would not have the pictures.
    #[error("{metric} refused the pictures: {why}")]
    Refused {
        /// The metric.
        metric: &'static str,
        /// What it said.
        why: String,
    },
    /// The resolution of the viewing condition is out of range.
    #[error(
        "the resolution must be {least} to {most} pixels per degree of the visual field, not {0}",
        least = RESOLUTIONS.start(),
        most = RESOLUTIONS.end()
    )]
    Resolution(f64),
}

/// A display-encoded picture: sRGB values in [0, 1], row-major. Values outside are clamped by those who look, and NaN is black.
#[derive(Clone, Copy, Debug)]
pub struct Image<'a> {
    width: usize,
    height: usize,
    pixels: &'a [Rgb],
}

impl<'a> Image<'a> {
    /// A picture of `width`×`height` pixels.
    ///
    /// # Errors
    /// [`ImageError`] if the size is out of range, or the number of pixels another.
    pub fn new(width: usize, height: usize, pixels: &'a [Rgb]) -> Result<Self, ImageError> {
        check_image(width, height)?;
        let expected = width * height;
        if pixels.len() != expected {
            return Err(ImageError::Pixels { width, height, expected, got: pixels.len() });
        }
        Ok(Self { width, height, pixels })
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels, row-major.
    pub fn pixels(&self) -> &'a [Rgb] {
        self.pixels
    }

    pub(crate) fn check_pair(&self, other: &Self) -> Result<(), ImageError> {
        let (a, b) = ((self.width, self.height), (other.width, other.height));
        if a == b { Ok(()) } else { Err(ImageError::Differ(a, b)) }
    }
}

/// One number a pixel, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// The numbers, at least one; what they mean is said by what made them.
    pub values: Vec<f32>,
}

impl Map {
    /// Mean of all numbers.
    pub fn mean(&self) -> f64 {
        self.values.iter().map(|&v| f64::from(v)).sum::<f64>() / self.values.len() as f64
    }

    /// The largest number.
    pub fn max(&self) -> f64 {
        self.values.iter().copied().fold(f32::NEG_INFINITY, f32::max).into()
    }

    /// (mean of |v|ᵖ)^(1/p), for p > 0.
    pub fn norm(&self, p: f64) -> f64 {
        let sum: f64 = self.values.iter().map(|&v| f64::from(v.abs()).powf(p)).sum();
        (sum / self.values.len() as f64).powf(1.0 / p)
    }

    /// Share of the numbers that lie above `limit`, in [0, 1].
    pub fn share_above(&self, limit: f32) -> f64 {
        self.values.iter().filter(|&&v| v > limit).count() as f64 / self.values.len() as f64
    }
}
