//! Every metric of a picture against its reference.

use super::arithmetic::{psnr, relative_mse};
#[cfg(feature = "butteraugli")]
use super::butteraugli;
use super::cvvdp::cvvdp;
#[cfg(feature = "flip")]
use super::flip;
use crate::picture::{DifferenceMap, DisplayPixels, MetricError};
use noisefloor::{Rgb, display::Display};
use noisefloor_vision::Viewing;
use serde::Serialize;

/// A picture, the reference that it is compared with, and how both are shown. All metrics see them through
/// the same tone mapping and, where they ask for one, the same viewing conditions.
///
/// ```
/// use noisefloor::{Rgb, display::Display};
/// use noisefloor_rivals::metrics::MetricPair;
/// use noisefloor_vision::Viewing;
///
/// let reference: Vec<Rgb> = (0..64 * 64).map(|i| [(i % 64) as f32 / 64.0; 3]).collect();
/// let image: Vec<Rgb> = reference.iter().map(|p| p.map(|c| c + 0.02)).collect();
/// let pair = MetricPair {
///     size: (64, 64),
///     image: &image,
///     reference: &reference,
///     display: &Display::SRGB,
///     viewing: &"laptop".parse::<Viewing>()?,
/// };
/// let (scores, maps) = pair.measure()?;
/// assert!(scores.cvvdp_jod < 10.0 && maps.cvvdp.values.len() == 64 * 64);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct MetricPair<'a> {
    /// Width and height in pixels, at least 2×2; butteraugli needs 8×8.
    pub size: (usize, usize),
    /// Linear radiance, row-major.
    pub image: &'a [Rgb],
    /// Linear radiance, row-major.
    pub reference: &'a [Rgb],
    /// From radiance to display values; settle it for the reference.
    pub display: &'a Display,
    /// For ColorVideoVDP, and, by its pixels per degree, for FLIP.
    pub viewing: &'a Viewing,
}

/// How far a picture is from its reference, by every metric of this build.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MetricScores {
    /// [`cvvdp`]: 10 is no visible difference; at 9, three of four people prefer the reference.
    pub cvvdp_jod: f64,
    /// Mean of FLIP over the pixels, in [0, 1]. `None` without the feature `flip`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flip: Option<f64>,
    /// Largest value of butteraugli; below 1 pictures look the same. `None` without the feature
    /// `butteraugli`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub butteraugli: Option<f64>,
    /// Its 3-norm, which its authors recommend as an average.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub butteraugli_norm3: Option<f64>,
    /// [`psnr`] of display values in dB; infinite for equal pictures, which JSON writes as null.
    pub psnr: f64,
    /// [`relative_mse`] of linear radiance.
    pub rel_mse: f64,
}

/// Where a picture differs from its reference.
#[derive(Clone, Debug, PartialEq)]
pub struct MetricMaps {
    /// JODs lost.
    pub cvvdp: DifferenceMap,
    /// FLIP, in [0, 1]. `None` without the feature `flip`.
    pub flip: Option<DifferenceMap>,
    /// Butteraugli. `None` without the feature `butteraugli`.
    pub butteraugli: Option<DifferenceMap>,
}

impl MetricPair<'_> {
    /// Every metric of this build, and its map.
    ///
    /// # Errors
    /// [`MetricError`] if sizes do not match, the pictures are too small for a metric, a value is not
    /// finite, or FLIP cannot serve the pixels per degree (above 1000).
    pub fn measure(&self) -> Result<(MetricScores, MetricMaps), MetricError> {
        let (width, height) = self.size;
        for (picture, pixels) in [("picture", self.image), ("reference", self.reference)] {
            DisplayPixels::new(width, height, pixels)?;
            if let Some(bad) = pixels.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
                return Err(MetricError::NotFinite { picture, x: bad % width, y: bad / width });
            }
        }
        let [image, reference] = [self.image, self.reference]
            .map(|pixels| pixels.iter().map(|&p| self.display.encode(p)).collect::<Vec<Rgb>>());
        let (cvvdp_jod, cvvdp) = cvvdp(&reference, &image, width, height, self.viewing)?;
        let flip = flip_of(&reference, &image, self)?;
        let butteraugli = butteraugli_of(&reference, &image, self)?;
        let scores = MetricScores {
            cvvdp_jod,
            flip: flip.as_ref().map(DifferenceMap::mean),
            butteraugli: butteraugli.as_ref().map(DifferenceMap::max),
            butteraugli_norm3: butteraugli.as_ref().map(|map| map.norm(3.0)),
            psnr: psnr(&image, &reference)?,
            rel_mse: relative_mse(self.image, self.reference)?,
        };
        Ok((scores, MetricMaps { cvvdp, flip, butteraugli }))
    }
}

/// `None` if this build has no FLIP.
#[cfg_attr(not(feature = "flip"), allow(unused_variables, reason = "nothing to compare with"))]
fn flip_of(
    reference: &[Rgb],
    image: &[Rgb],
    pair: &MetricPair<'_>,
) -> Result<Option<DifferenceMap>, MetricError> {
    #[cfg(feature = "flip")]
    return flip::flip(reference, image, pair.size.0, pair.size.1, pair.viewing.pixels_per_degree())
        .map(Some);
    #[cfg(not(feature = "flip"))]
    Ok(None)
}

/// `None` if this build has no butteraugli.
#[cfg_attr(not(feature = "butteraugli"), allow(unused_variables, reason = "nothing to compare with"))]
fn butteraugli_of(
    reference: &[Rgb],
    image: &[Rgb],
    pair: &MetricPair<'_>,
) -> Result<Option<DifferenceMap>, MetricError> {
    #[cfg(feature = "butteraugli")]
    return butteraugli::butteraugli(reference, image, pair.size.0, pair.size.1).map(Some);
    #[cfg(not(feature = "butteraugli"))]
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measure(image: &[Rgb], reference: &[Rgb]) -> Result<(MetricScores, MetricMaps), MetricError> {
        let viewing = Viewing::default();
        MetricPair { size: (16, 12), image, reference, display: &Display::SRGB, viewing: &viewing }.measure()
    }

    #[test]
    fn pictures_that_are_alike_have_the_best_scores() {
        let grey: Vec<Rgb> = (0..192).map(|i| [i as f32 / 192.0; 3]).collect();
        let (scores, maps) = measure(&grey, &grey).unwrap();
        assert!((scores.cvvdp_jod - 10.0).abs() < 1e-6 && maps.cvvdp.max() < 1e-6, "{scores:?}");
        assert_eq!((scores.psnr, scores.rel_mse), (f64::INFINITY, 0.0));
        assert_eq!(scores.flip, cfg!(feature = "flip").then_some(0.0));
        assert_eq!(scores.butteraugli, cfg!(feature = "butteraugli").then_some(0.0));
        let json = serde_json::to_value(scores).unwrap();
        assert!(json["psnr"].is_null() && json["rel_mse"] == 0.0, "{json}");
        assert_eq!(json.get("flip").is_some(), cfg!(feature = "flip"));
    }

    /// 0.2 and 0.3 of linear light: PSNR by the encoded values, relMSE by the linear ones.
    #[test]
    fn scores_of_greys_are_those_of_arithmetic() {
        let (scores, _) = measure(&[[0.3; 3]; 192], &[[0.2; 3]; 192]).unwrap();
        assert!((scores.rel_mse - 0.01 / 0.05).abs() < 1e-6, "{scores:?}");
        let encode = |linear: f64| 1.055 * linear.powf(1.0 / 2.4) - 0.055;
        let psnr = -20.0 * (encode(0.3) - encode(0.2)).log10();
        assert!((scores.psnr - psnr).abs() < 1e-3, "{scores:?}, {psnr}");
        // ColorVideoVDP goes by contrast: a change of the whole picture's brightness costs nothing
        assert!((scores.cvvdp_jod - 10.0).abs() < 1e-6, "{scores:?}");
    }

    #[test]
    fn what_does_not_fit_is_an_error() {
        let grey = [[0.5; 3]; 192];
        assert!(matches!(measure(&grey, &grey[1..]), Err(MetricError::Pixels { .. })));
        let mut odd = grey;
        odd[18][1] = f32::INFINITY;
        let at = |picture| MetricError::NotFinite { picture, x: 2, y: 1 };
        assert_eq!(measure(&odd, &grey), Err(at("picture")));
        assert_eq!(measure(&grey, &odd), Err(at("reference")));
    }
}
