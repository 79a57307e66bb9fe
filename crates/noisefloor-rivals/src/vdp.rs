//! The visible differences predictor of Daly 1993.

mod cortex;
mod csf;
mod fourier;

use crate::picture::{DifferenceMap, DisplayPixels, MetricError};
use cortex::Cortex;
use csf::VdpViewing;
use noisefloor::display::{luminance, srgb_decode};
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// Daly's amplitude nonlinearity, R = L/(L + (12.6·L)^0.63), for L in cd/m².
const AMPLITUDE: (f64, f64) = (12.6, 0.63);
/// Slope β of the psychometric function.
const PSYCHOMETRIC: f32 = 3.5;

/// Daly 1993, "The Visible Differences Predictor: An Algorithm for the Assessment of Image Fidelity": where,
/// and with what probability, an observer sees a difference between two pictures.
///
/// | stage | formula | parameters |
/// |---|---|---|
/// | display | L = peak·Y, Y of decoded sRGB | 100 cd/m² |
/// | amplitude nonlinearity | R = L/(L + (c₁L)^b) | c₁ = 12.6, b = 0.63 |
/// | contrast | C = (R/R_a − 1)/(d ln R/d ln L)_a, at the adaptation level a | 18 cd/m² |
/// | contrast sensitivity | as of Daly, at 40 pixels per degree | P = 250, ε = 0.9, ob = 0.78 |
/// | cortex transform | dom and fan filters, see below | 5 × 6 + 1 bands |
/// | masking | T = (1 + (k₁(k₂m)^s)^b)^(1/b), m in threshold units | k₁ = 6^(−7/3), k₂ = 6^(10/3), b = 4 |
/// | mutual masking | the lesser m of the two pictures | |
/// | phase uncertainty | m is the local amplitude of the band | |
/// | psychometric function | 1 − 2^−(ΔC·S/T)^β | β = 3.5 |
/// | probability summation | 1 − ∏(1 − P) over the bands | |
///
/// Dom filters are differences of mesa filters at ρ½ = 1, ½ … 1/16 of a cycle per pixel, of transition width
/// ⅔ρ½; the base band is a Gaussian cut at 4/3·ρ½, with σ a third of that. Fan filters span ±30°, in 6
/// orientations. The slope s of masking is 0.7 for the base band, 0.8 for the lowest two dom bands and 1 for
/// the others.
///
/// The parameters are Daly's, from secondary sources: Mantiuk's HDR-VDP 1 for the cortex transform and the
/// slopes s, which it has from Daly's patent; Ashraf et al. 2024 for the sensitivity. Sources differ on three
/// points or leave them open; our choices:
/// - Contrast is scaled so that the amplitude nonlinearity does not change the contrast of a faint grating
///   around the adaptation level. Otherwise, thresholds would not be those of the contrast sensitivity
///   function.
/// - The psychometric function is ½ at the threshold instead of 1 − 1/e, consistent with the thresholds of
///   this project.
/// - Local amplitude is that of a complex cortex transform (Lukin 2009) instead of a blur of |C|.
///
/// If a grating's frequency or orientation lies between two bands, each band sees half of it, and the
/// predicted threshold is up to 1.65 times as high (2.7 times for both). This is a property of Daly's bands
/// and summation.
///
/// With these k₁ and k₂, a mask at its own threshold raises the threshold by 2^¼ = 1.19 if s is 0.7, but
/// sixfold if s is 1: noise hides noise, and of two pictures compared with a noisy one, the cleaner one
/// differs more visibly. Yee 2004 uses 0.7 in all bands.
///
/// Luminance only. Pictures are extended by mirroring. Transforms are cached for one size. A comparison of
/// 512×512 pixels takes 0.5 s on two cores (`benches/metrics.rs`, on a machine that was not idle), and about
/// 100 bytes of memory per pixel.
///
/// ```
/// use noisefloor_rivals::{DisplayPixels, Vdp};
///
/// let (grey, mut lines) = (vec![[0.5_f32; 3]; 64 * 64], vec![[0.5_f32; 3]; 64 * 64]);
/// lines.iter_mut().step_by(8).for_each(|pixel| *pixel = [0.6; 3]);
/// let (grey, lines) = (DisplayPixels::new(64, 64, &grey)?, DisplayPixels::new(64, 64, &lines)?);
/// let vdp = Vdp::default();
/// assert_eq!(vdp.visible(&grey, &grey)?.max(), 0.0);
/// assert!(vdp.visible(&grey, &lines)?.max() > 0.99);
/// # Ok::<(), noisefloor_rivals::MetricError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Vdp {
    viewing: VdpViewing,
    cortex: Arc<Mutex<Option<Arc<Cortex>>>>,
}

/// The response of the eye to a picture: contrast after the amplitude nonlinearity.
#[derive(Clone, Debug)]
pub(crate) struct Response {
    width: usize,
    height: usize,
    contrast: Vec<f32>,
}

impl Vdp {
    /// The probability, in [0, 1], that an observer sees a difference at each pixel of two pictures.
    /// Symmetric.
    pub fn visible(
        &self,
        a: &DisplayPixels<'_>,
        b: &DisplayPixels<'_>,
    ) -> Result<DifferenceMap, MetricError> {
        a.check_pair(b)?;
        let values = self.detect(&self.respond(a), &self.respond(b));
        Ok(DifferenceMap { width: a.width(), height: a.height(), values })
    }

    pub(crate) fn respond(&self, image: &DisplayPixels<'_>) -> Response {
        let VdpViewing { peak, adaptation, .. } = self.viewing;
        let (c, b) = AMPLITUDE;
        let amplitude = |l: f64| if l > 0.0 { l / (l + (c * l).powf(b)) } else { 0.0 };
        // d ln R/d ln L = (1 − b)·(cL)^b/(L + (cL)^b)
        let bend = (c * adaptation).powf(b);
        let slope = (1.0 - b) * bend / (adaptation + bend);
        let level = amplitude(adaptation);
        let contrast = |pixel: &[f32; 3]| {
            let linear = pixel.map(|channel| srgb_decode(if channel.is_nan() { 0.0 } else { channel }));
            ((amplitude(peak * f64::from(luminance(linear))) / level - 1.0) / slope) as f32
        };
        let contrast = image.pixels().par_iter().map(contrast).collect();
        Response { width: image.width(), height: image.height(), contrast }
    }

    /// Probability of detection at each pixel, row-major, of two responses of the same size.
    pub(crate) fn detect(&self, a: &Response, b: &Response) -> Vec<f32> {
        let cortex = self.cortex(a.width, a.height);
        let spectra = [a, b].map(|r| cortex.spectrum(&r.contrast));
        // −log₂(1 − P), summed over the bands.
        let mut sum = vec![0.0f32; a.contrast.len()];
        for band in cortex.bands() {
            let [a, b] = [&spectra[0], &spectra[1]].map(|spectrum| cortex.filter(spectrum, band));
            sum.par_chunks_mut(cortex.width()).enumerate().for_each(|(y, row)| {
                for (x, sum) in row.iter_mut().enumerate() {
                    let (a, b) = (cortex.at(&a, x, y), cortex.at(&b, x, y));
                    let difference = (a.re - b.re).abs();
                    // Less than 10⁻¹⁰ otherwise.
                    if difference > 1e-3 {
                        let masked = band.elevation(a.norm().min(b.norm()));
                        *sum += (difference / masked).powf(PSYCHOMETRIC);
                    }
                }
            });
        }
        sum.par_iter_mut().for_each(|s| *s = 1.0 - (-*s).exp2());
        sum
    }

    fn cortex(&self, width: usize, height: usize) -> Arc<Cortex> {
        let mut cached = self.cortex.lock().unwrap_or_else(PoisonError::into_inner);
        match &*cached {
            Some(cortex) if (cortex.width(), cortex.height()) == (width, height) => Arc::clone(cortex),
            _ => Arc::clone(cached.insert(Arc::new(Cortex::new(&self.viewing, width, height)))),
        }
    }
}

#[cfg(test)]
mod tests;
