//! The cortex transform (Watson 1987; Daly 1993), with complex bands (Lukin 2009).

use super::csf::VdpViewing;
use super::fourier::{Fourier, quick_length};
use rayon::prelude::*;
use rustfft::num_complex::Complex32;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI};

/// Bands of frequency with orientations, beside the base band.
const DOMS: usize = 5;
const FANS: usize = 6;
/// Pixels of mirrored picture between its end and its beginning.
const MARGIN: usize = 32;

/// One band of frequencies and orientations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Band {
    /// From the highest frequencies down; the base band is [`DOMS`].
    dom: usize,
    fan: usize,
}

impl Band {
    /// Threshold elevation by a mask whose local amplitude is `mask` times its own threshold: T = (1 +
    /// (k₁(k₂m)^s)^b)^(1/b).
    pub(super) fn elevation(self, mask: f32) -> f32 {
        let slope = match self.dom {
            DOMS => 0.7,
            3 | 4 => 0.8,
            _ => 1.0,
        };
        // k₁ = 6^(1 − 1/(1 − 0.7)), k₂ = 6^(1/(1 − 0.7))
        let (k1, k2) = (0.015_29, 392.5);
        let rise: f32 = k1 * (k2 * mask).powf(slope);
        (1.0 + rise.powi(4)).sqrt().sqrt()
    }
}

/// Filters and transforms for pictures of one size.
#[derive(Debug)]
pub(super) struct Cortex {
    width: usize,
    height: usize,
    fourier: Fourier,
    /// Contrast sensitivity at each frequency of a spectrum, over the number of its values.
    sensitivity: Vec<f32>,
    /// Weights of the frequency bands and of the orientations.
    doms: Vec<Vec<f32>>,
    fans: Vec<Vec<f32>>,
}

/// 1 up to ⅔·`half`, 0 from 4/3·`half`, and ½ at `half`, with a cosine in between.
fn mesa(rho: f64, half: f64) -> f64 {
    let width = 2.0 / 3.0 * half;
    let place = ((rho - half) / width + 0.5).clamp(0.0, 1.0);
    0.5 * (1.0 + (PI * place).cos())
}

/// The base band: a Gaussian that ends where the mesa filter of the same cut-off does.
fn base(rho: f64) -> f64 {
    let half = 0.5f64.powi(DOMS as i32);
    let end = 4.0 / 3.0 * half;
    let sigma = end / 3.0;
    if rho < end { (-rho * rho / (2.0 * sigma * sigma)).exp() } else { 0.0 }
}

/// Weight of band `dom` at `rho` cycles per pixel; all bands together are 1.
fn dom_weight(dom: usize, rho: f64) -> f64 {
    // The first band takes in the corners of the spectrum too.
    let upper = if dom == 0 { 1.0 } else { mesa(rho, 0.5f64.powi(dom as i32)) };
    match dom {
        DOMS => base(rho),
        _ if dom == DOMS - 1 => (upper - base(rho)).max(0.0),
        _ => upper - mesa(rho, 0.5f64.powi(dom as i32 + 1)),
    }
}

/// Weight of orientation `fan` at `angle` radians: twice that in the half plane around its centre, for
/// complex bands, and 0 in the other; all orientations together are 1 on average over the two.
fn fan_weight(fan: usize, angle: f64) -> f64 {
    let center = fan as f64 * FRAC_PI_6 - FRAC_PI_2;
    let distance = (angle - center + PI).rem_euclid(2.0 * PI) - PI;
    if distance.abs() < FRAC_PI_6 { 1.0 + (PI * distance / FRAC_PI_6).cos() } else { 0.0 }
}

/// Frequency of place `i` of `n`, in cycles per pixel, in (−½, ½].
fn frequency(i: usize, n: usize) -> f64 {
    let signed = if 2 * i > n { i as f64 - n as f64 } else { i as f64 };
    signed / n as f64
}

/// The pixel at place `i` of a row of `n` pixels that is extended by mirroring to a period of `period`.
fn mirrored(i: usize, n: usize, period: usize) -> usize {
    let beyond = i.saturating_sub(n);
    match i {
        _ if i < n => i,
        _ if 2 * beyond < period - n => (n - 1).saturating_sub(beyond),
        _ => (period - 1 - i).min(n - 1),
    }
}

impl Cortex {
    pub(super) fn new(viewing: &VdpViewing, width: usize, height: usize) -> Self {
        let fourier = Fourier::new(quick_length(width + MARGIN), quick_length(height + MARGIN));
        let per_degree = viewing.pixels_per_degree();
        let area = width as f64 * height as f64 / (per_degree * per_degree);
        let (w, h) = (fourier.width, fourier.height);
        let scale = 1.0 / (w * h) as f64;
        let each = |value: &(dyn Fn(f64, f64) -> f64 + Sync)| -> Vec<f32> {
            let at = |i: usize| value(frequency(i / h, w), frequency(i % h, h)) as f32;
            (0..w * h).into_par_iter().map(at).collect()
        };
        let rho = |u: f64, v: f64| u.hypot(v);
        let sensitivity = each(&|u, v| scale * viewing.sensitivity(rho(u, v) * per_degree, v.atan2(u), area));
        let doms = (0..=DOMS).map(|dom| each(&|u, v| dom_weight(dom, rho(u, v)))).collect();
        // Frequencies of half a cycle are their own opposites, and belong to both half planes.
        let own_opposite = |x: f64| (x - 0.5).abs() < 1e-12;
        let fans = (0..FANS).map(|fan| {
            each(&|u, v| {
                let angle = v.atan2(u);
                if own_opposite(u) || own_opposite(v) {
                    0.5 * (fan_weight(fan, angle) + fan_weight(fan, angle + PI))
                } else {
                    fan_weight(fan, angle)
                }
            })
        });
        Self { width, height, sensitivity, doms, fans: fans.collect(), fourier }
    }

    pub(super) fn width(&self) -> usize {
        self.width
    }

    pub(super) fn height(&self) -> usize {
        self.height
    }

    pub(super) fn bands(&self) -> impl Iterator<Item = Band> + use<> {
        let oriented = (0..DOMS).flat_map(|dom| (0..FANS).map(move |fan| Band { dom, fan }));
        oriented.chain([Band { dom: DOMS, fan: 0 }])
    }

    /// Spectrum of a row-major plane of contrast, in units of threshold.
    pub(super) fn spectrum(&self, contrast: &[f32]) -> Vec<Complex32> {
        let (w, h) = (self.fourier.width, self.fourier.height);
        let pixel = |i: usize| {
            let (x, y) = (mirrored(i % w, self.width, w), mirrored(i / w, self.height, h));
            Complex32::new(contrast[y * self.width + x], 0.0)
        };
        let mut spectrum = self.fourier.forward((0..w * h).map(pixel).collect());
        spectrum.iter_mut().zip(&self.sensitivity).for_each(|(value, &s)| *value *= s);
        spectrum
    }

    /// One band: its real part is the band, its absolute value the local amplitude.
    pub(super) fn filter(&self, spectrum: &[Complex32], band: Band) -> Vec<Complex32> {
        let dom = &self.doms[band.dom];
        let weighted: Vec<Complex32> = if band.dom == DOMS {
            spectrum.iter().zip(dom).map(|(value, d)| value * d).collect()
        } else {
            spectrum
                .iter()
                .zip(dom)
                .zip(&self.fans[band.fan])
                .map(|((value, d), f)| value * (d * f))
                .collect()
        };
        self.fourier.inverse(weighted)
    }

    /// Pixel (`x`, `y`) of a band.
    pub(super) fn at(&self, band: &[Complex32], x: usize, y: usize) -> Complex32 {
        band[y * self.fourier.width + x]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor_testkit::Noise;

    #[test]
    fn bands_add_up_to_the_picture() {
        for (width, height) in [(50, 40), (31, 64)] {
            let cortex = Cortex::new(&VdpViewing::default(), width, height);
            let mut noise = Noise::new(7);
            let plane: Vec<f32> = (0..width * height).map(|_| noise.normal() as f32).collect();
            let spectrum = cortex.spectrum(&plane);
            let whole = cortex.fourier.inverse(spectrum.clone());
            let mut sum = vec![0.0; whole.len()];
            for band in cortex.bands() {
                let filtered = cortex.filter(&spectrum, band);
                sum.iter_mut().zip(filtered).for_each(|(sum, value)| *sum += value.re);
            }
            let largest = whole.iter().map(|v| v.re.abs()).fold(0.0, f32::max);
            let worst = whole.iter().zip(&sum).map(|(v, s)| (v.re - s).abs()).fold(0.0, f32::max);
            assert!(worst < 1e-4 * largest, "{width}×{height}: {worst} of {largest}");
        }
    }

    #[test]
    fn a_band_knows_the_local_amplitude() {
        // A wave in the middle of a band: |band| is its amplitude times its sensitivity everywhere but near
        // the edge.
        let viewing = VdpViewing::default();
        let cortex = Cortex::new(&viewing, 216, 216);
        let wave = |i: usize| 0.5 * (std::f64::consts::TAU * (i % 216) as f64 / 6.0).cos() as f32;
        let plane: Vec<f32> = (0..216 * 216).map(wave).collect();
        let band = Band { dom: 2, fan: 3 };
        let filtered = cortex.filter(&cortex.spectrum(&plane), band);
        let per_degree = viewing.pixels_per_degree();
        let expected = 0.5 * viewing.sensitivity(per_degree / 6.0, 0.0, (216.0 / per_degree).powi(2)) as f32;
        for x in 90..120 {
            let value = cortex.at(&filtered, x, 108);
            assert!((value.norm() / expected - 1.0).abs() < 0.03, "{x}: {} of {expected}", value.norm());
        }
    }

    #[test]
    fn elevation_has_its_published_ends() {
        for (dom, slope) in [(0, 1.0), (2, 1.0), (4, 0.8), (DOMS, 0.7)] {
            let band = Band { dom, fan: 0 };
            assert_eq!(band.elevation(0.0), 1.0);
            let rise = (band.elevation(1e5) / band.elevation(1e4)).log10();
            assert!((rise - slope).abs() < 1e-3, "{dom}: {rise}");
        }
        // k₁ = 6^(−7/3), k₂ = 6^(10/3): with the slope of 0.7, k₁(k₂m)^s is 1 at the threshold itself.
        assert!((Band { dom: DOMS, fan: 0 }.elevation(1.0) - 2f32.powf(0.25)).abs() < 1e-3);
    }

    #[test]
    fn mirrors_meet() {
        // 4 pixels, a period of 9: 0 1 2 3 | 3 2 1 | 1 0
        let places: Vec<usize> = (0..9).map(|i| mirrored(i, 4, 9)).collect();
        assert_eq!(places, [0, 1, 2, 3, 3, 2, 1, 1, 0]);
        assert!((0..40).all(|i| mirrored(i, 1, 40) == 0));
    }
}
