//! Albedo and normals for the halves of a film, and whether they are clean.
//!
//! A denoiser that may take them at their word keeps more of the picture (`cleanAux` of Open Image Denoise); but then
//! noise in them becomes noise of the picture. Two pictures of them, independent of each other, tell which it is.

use crate::denoiser::{DenoiseError, Denoiser, cut};
use noisefloor::{ProgressiveSource, Rgb, SourceError, Tile, source::FirstHits};
use thiserror::Error;

/// Root mean square of the noise of albedo and normals, in the noisiest square of [`SQUARE`] pixels, up to which they
/// are clean.
const CLEAN: f64 = 0.02;
const SQUARE: usize = 64;
/// Rays a pixel of the first pictures of a source, and how many times more the next ones have.
const FIRST_SPP: u64 = 32;
const MORE: u64 = 4;

/// Albedo and normals: one picture for each half of a film, independent of each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Guides {
    halves: [FirstHits; 2],
    clean: bool,
}

impl Guides {
    /// These pictures, from [`ProgressiveSource::first_hits`] for instance. By what they differ in they say whether they are
    /// clean.
    pub fn new(halves: [FirstHits; 2]) -> Self {
        let clean = noise(&halves).all(|variance| variance <= CLEAN * CLEAN);
        Self { halves, clean }
    }

    /// Renders them: again with more rays, up to `most` a pixel for each half, until they are clean. What is not is
    /// cleaned by the denoiser, if it can do that. `None` if the denoiser makes no use of them, or the source has none.
    ///
    /// # Errors
    /// [`GuideError`] if the source or the denoiser fails.
    pub fn render(
        source: &mut (impl ProgressiveSource + ?Sized),
        denoiser: &mut impl Denoiser,
        most: u64,
    ) -> Result<Option<Self>, GuideError> {
        if !denoiser.wants().any() {
            return Ok(None);
        }
        let mut spp = FIRST_SPP.min(most);
        loop {
            let [Some(a), Some(b)] = [source.first_hits(0, spp)?, source.first_hits(1, spp)?] else {
                return Ok(None);
            };
            let guides = Self::new([a, b]);
            if guides.clean {
                return Ok(Some(guides));
            }
            if spp.saturating_mul(MORE) > most {
                return Ok(Some(guides.prefiltered(denoiser)?));
            }
            spp *= MORE;
        }
    }

    /// The same without their noise, if the denoiser can take it away, each picture by itself.
    ///
    /// # Errors
    /// [`DenoiseError`] if it fails.
    pub fn prefiltered(self, denoiser: &mut impl Denoiser) -> Result<Self, DenoiseError> {
        let [a, b] = &self.halves;
        match (denoiser.prefilter(a)?, denoiser.prefilter(b)?) {
            (Some(a), Some(b)) => Ok(Self { halves: [a, b], clean: true }),
            _ => Ok(self),
        }
    }

    /// Whether they have no noise that could be seen in a denoised picture.
    pub fn is_clean(&self) -> bool {
        self.clean
    }

    /// The picture of each half.
    pub fn halves(&self) -> &[FirstHits; 2] {
        &self.halves
    }

    /// A rectangle of them, within the pictures.
    #[must_use]
    pub fn part(&self, part: Tile) -> Self {
        let halves = self.halves.each_ref().map(|half| {
            let [albedo, normal] = [&half.albedo, &half.normal].map(|plane| cut(plane, half.width, part));
            FirstHits::new((part.width, part.height), albedo, normal)
        });
        Self { halves, clean: self.clean }
    }

    /// The mean of both, for the picture that is denoised from all samples.
    pub fn together(&self) -> FirstHits {
        let [a, b] = &self.halves;
        let mean = |a: &[Rgb], b: &[Rgb]| -> Vec<Rgb> {
            a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect()
        };
        let (albedo, normal) = (mean(&a.albedo, &b.albedo), mean(&a.normal, &b.normal));
        FirstHits::new((a.width, a.height), albedo, normal)
    }
}

/// Why there are no pictures of first hits.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum GuideError {
    /// The source failed.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The denoiser, which was to clean them, failed.
    #[error(transparent)]
    Denoise(#[from] DenoiseError),
}

/// Variance of the noise of each half, square by square; NaN where a value is not finite.
fn noise([a, b]: &[FirstHits; 2]) -> impl Iterator<Item = f64> {
    let squared = |a: &Rgb, b: &Rgb| -> f64 { a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum() };
    let pixels = a.albedo.iter().zip(&b.albedo).zip(a.normal.iter().zip(&b.normal));
    // The difference of two pictures has twice the variance of one; values of each pixel are six
    let variance: Vec<f64> =
        pixels.map(|((a, b), (na, nb))| (squared(a, b) + squared(na, nb)) / 12.0).collect();
    let (width, height) = (a.width, a.height);
    let edge = |n: usize, side: usize| n * side / side.div_ceil(SQUARE);
    let places =
        move |side: usize| (0..side.div_ceil(SQUARE)).map(move |n| (edge(n, side), edge(n + 1, side)));
    let squares = places(height).flat_map(move |rows| places(width).map(move |columns| (rows, columns)));
    squares.map(move |((top, bottom), (left, right))| {
        let rows = (top..bottom).filter_map(|y| variance.get(y * width + left..y * width + right));
        rows.flatten().sum::<f64>() / ((bottom - top) * (right - left)) as f64
    })
}
