//! From linear radiance to what a screen shows: exposure, tone mapping, luminance.

use crate::rgb::Rgb;
use exposure::{DELTA, LogAverage};
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use thiserror::Error;

mod cube;
pub(crate) mod exposure;
mod lut;
mod srgb;
mod tone_curve;
mod tone_table;
pub use tone_curve::ToneCurve;
pub use tone_table::ToneTableError;

// For the crates of this repository; LUTs are on the pages of noisefloor-image, which reads their files
#[doc(hidden)]
pub use {
    crate::rgb::luminance,
    cube::{CubeError, parse_cube},
    lut::{ColourLut, LutInput, LutInputError},
    srgb::{srgb_decode, srgb_encode},
};

/// Key of an average scene (Reinhard et al. 2002, §3.1): what the log-average luminance is mapped to.
#[doc(hidden)]
pub const DEFAULT_KEY: f32 = 0.18;

/// Least and most that an exposure can be.
const DIMMEST: f32 = f32::from_bits(1);
pub(crate) const BRIGHTEST: f32 = f32::MAX;

/// How a picture is to be displayed, before its exposure is known.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "files", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum ToneMapping {
    /// The photographic operator, global form (Reinhard et al. 2002, eqs. 1–4).
    Reinhard {
        /// What the log-average luminance becomes, above 0; 0.18 for an average scene.
        key: f32,
        /// Smallest luminance that becomes white, after exposure, above 0; `None` compresses without
        /// burning out (eq. 3).
        white: Option<f32>,
    },
    /// Plain sRGB: multiply, clamp to [0, 1], encode.
    Srgb {
        /// Factor on linear radiance, above 0; 1 shows radiance 1 as white.
        exposure: f32,
    },
    /// A function of the caller's own, such as a LUT.
    Custom {
        /// Factor on linear radiance, above 0, before the function.
        exposure: f32,
        /// From exposed radiance to display values.
        curve: ToneCurve,
    },
    // Model files number the variants: new ones come last
    /// The photographic operator with a given exposure, such as that of the first frame of a sequence: settled
    /// anew, the exposures of frames differ by their noise, and the film flickers.
    ReinhardAt {
        /// Factor on linear radiance, above 0: the key over the log-average ([`Display::exposure`]).
        exposure: f32,
        /// As for [`ToneMapping::Reinhard`].
        white: Option<f32>,
    },
}

impl Default for ToneMapping {
    fn default() -> Self {
        Self::Reinhard { key: DEFAULT_KEY, white: None }
    }
}

/// A tone mapping that cannot be used.
#[derive(Debug, Error, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum ToneMappingError {
    /// A parameter is not a positive finite number.
    #[error("{name} must be a positive finite number, not {value}")]
    Number {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f32,
    },
}

impl ToneMapping {
    /// Checks the parameters.
    ///
    /// # Errors
    /// [`ToneMappingError`] if one is not a positive finite number.
    pub fn check(&self) -> Result<(), ToneMappingError> {
        let positive = |name, value: f32| {
            if value.is_finite() && value > 0.0 {
                Ok(())
            } else {
                Err(ToneMappingError::Number { name, value })
            }
        };
        match *self {
            Self::Reinhard { key: number, white } | Self::ReinhardAt { exposure: number, white } => {
                let fixed = matches!(self, Self::ReinhardAt { .. });
                let name = if fixed {
                    "the exposure of Reinhard tone mapping"
                } else {
                    "the key of Reinhard tone mapping"
                };
                positive(name, number)?;
                white.map_or(Ok(()), |w| positive("the white point of Reinhard tone mapping", w))
            }
            Self::Srgb { exposure } => positive("the sRGB exposure", exposure),
            Self::Custom { exposure, .. } => positive("the exposure of a tone curve", exposure),
        }
    }

    /// Settles the exposure for a converged picture. Use the result for this picture, its halves and its
    /// reference alike: if the log-average drifted, the drift would look like noise. `pixels` are linear
    /// radiance; those that are black or not finite are skipped. A black picture gets exposure 1.
    ///
    /// Noise bends a log-average, by a factor of 20 where most pixels have met no light yet: a
    /// [`Session`](crate::Session) estimates that of the converged picture.
    ///
    /// # Panics
    /// If [`ToneMapping::check`] refuses the parameters.
    pub fn settle(&self, pixels: &[Rgb]) -> Display {
        self.settle_by(|| log_average(pixels).map(|value| LogAverage { value, error: 0.0 })).display
    }

    /// The display, by the log-average where it depends on that.
    pub(crate) fn settle_by(&self, log_average: impl FnOnce() -> Option<LogAverage>) -> Settled {
        if let Err(error) = self.check() {
            panic!("{error}");
        }
        let known = |exposure, curve| Settled { display: Display { exposure, curve }, error: 0.0 };
        match *self {
            Self::Custom { exposure, ref curve } => known(exposure, Curve::Custom(curve.clone())),
            Self::Reinhard { key, white } => {
                let curve = Curve::Reinhard { white };
                let Some(LogAverage { value, error }) = log_average() else { return known(1.0, curve) };
                // Light of less than 5·10⁻⁴⁰ asks for more than a number holds
                let exposure =
                    (f64::from(key) / value).clamp(f64::from(DIMMEST), f64::from(BRIGHTEST)) as f32;
                Settled { display: Display { exposure, curve }, error }
            }
            Self::ReinhardAt { exposure, white } => known(exposure, Curve::Reinhard { white }),
            Self::Srgb { exposure } => known(exposure, Curve::Clamp),
        }
    }
}

/// A display, and how well its exposure is known.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Settled {
    pub(crate) display: Display,
    /// Standard error of the exposure, as a share of it; 0 if it does not depend on the picture, or the
    /// picture is black.
    pub(crate) error: f64,
}

/// exp(mean ln(δ + L)), Reinhard et al. 2002, eq. 1 with the 1/N inside the exponential as their text has
/// it, over the pixels that are not black or next to black ([`exposure::counted`]): a model on black would else be shown the
/// brighter the smaller it is, until it burns out. `None` if there is none.
fn log_average(pixels: &[Rgb]) -> Option<f64> {
    let lit = || pixels.iter().map(|&p| f64::from(luminance(p))).filter(|&l| l > 0.0 && l.is_finite());
    let (roots, count) = lit().fold((0.0, 0.0), |(sum, n), l| (sum + l.sqrt(), n + 1.0));
    let faintest = exposure::faintest(roots / count);
    let geometric_mean = |delta: f64| {
        let (sum, count) = lit().fold((0.0, 0.0), |(sum, n), l| {
            let weight = exposure::counted(l.ln(), faintest);
            (sum + weight * (delta + l).ln(), n + weight)
        });
        (sum / count).exp()
    };
    (count > 0.0).then(|| geometric_mean(DELTA * geometric_mean(0.0)))
}

#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
enum Curve {
    Clamp,
    Reinhard { white: Option<f32> },
    Custom(ToneCurve),
}

impl Curve {
    /// b and c of L_d = L·(1 + b·L)/(1 + c·L), the same for every pixel.
    #[inline(always)]
    fn terms(&self) -> (f32, f32) {
        match *self {
            Self::Clamp | Self::Custom(_) => (0.0, 0.0),
            // A white point near 0 makes all white but black.
            Self::Reinhard { white } => (white.map_or(0.0, |w| (1.0 / (w * w)).min(f32::MAX)), 1.0),
        }
    }
}

/// A tone mapping with its exposure settled: a fixed function from linear radiance to display values.
///
/// ```
/// use noisefloor::ToneMapping;
/// let grey = [[0.5_f32; 3]; 4];
/// let display = ToneMapping::Reinhard { key: 0.18, white: None }.settle(&grey);
/// // A uniform picture has its own luminance as log-average: it is shown at 0.18 / (1 + 0.18), then sRGB-encoded.
/// let shown = display.luma([0.5; 3]);
/// assert!((shown - 0.427).abs() < 1e-3, "{shown}");
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub struct Display {
    exposure: f32,
    curve: Curve,
}

impl Display {
    /// Displays a picture unchanged: exposure 1, clamped, sRGB.
    pub const SRGB: Self = Self { exposure: 1.0, curve: Curve::Clamp };

    /// The factor that linear radiance is multiplied by.
    pub fn exposure(&self) -> f32 {
        self.exposure
    }

    /// Linear radiance → linear display values in [0, 1]. Negative radiance shows as black.
    #[inline(always)]
    pub fn map(&self, pixel: Rgb) -> Rgb {
        match &self.curve {
            Curve::Custom(curve) => curve.show(self.expose(pixel)).map(srgb_decode),
            _ => self.map_plain(pixel),
        }
    }

    /// Radiance that a curve can take: finite, and not negative.
    #[allow(clippy::manual_clamp, reason = "clamp would let NaN through; here it becomes black")]
    fn expose(&self, pixel: Rgb) -> Rgb {
        pixel.map(|c| (c * self.exposure).max(0.0).min(f32::MAX))
    }

    /// [`Display::map`] of the curves that this crate has.
    #[inline(always)]
    fn map_plain(&self, pixel: Rgb) -> Rgb {
        let exposed = pixel.map(|c| (c * self.exposure).max(0.0));
        let l = luminance(exposed).min(1e30);
        // eq. 4; without a white point eq. 3. Colours keep their ratios: L_d / L.
        let (burn, compress) = self.curve.terms();
        // Finite: what a channel without light is multiplied by
        let scale = ((1.0 + burn * l) / (1.0 + compress * l)).min(f32::MAX);
        exposed.map(|c| (c * scale).min(1.0))
    }

    /// Linear radiance → display-encoded sRGB in [0, 1].
    #[inline(always)]
    pub fn encode(&self, pixel: Rgb) -> Rgb {
        match &self.curve {
            Curve::Custom(curve) => curve.show(self.expose(pixel)),
            _ => self.encode_plain(pixel),
        }
    }

    /// [`Display::encode`] of the curves that this crate has.
    #[inline(always)]
    fn encode_plain(&self, pixel: Rgb) -> Rgb {
        self.map_plain(pixel).map(srgb_encode)
    }

    /// Linear radiance → display-encoded Rec.709 luminance in [0, 1]: the plane that observers are modelled
    /// on.
    #[inline(always)]
    pub fn luma(&self, pixel: Rgb) -> f32 {
        luminance(self.encode(pixel))
    }
}

#[cfg(test)]
impl Display {
    /// One that cannot be.
    pub(crate) fn corrupt() -> Self {
        Self { exposure: f32::NAN, curve: Curve::Clamp }
    }
}

/// The channels of pixels, each by itself, as vector instructions want them.
///
/// Inlined as the next, to be compiled for the vector instructions of whoever calls it.
#[inline(always)]
pub(crate) fn split_channels<const PIXELS: usize>(pixels: &[Rgb], channels: &mut [[f32; PIXELS]; 3]) {
    let [r, g, b] = channels.each_mut().map(|channel| &mut channel[..pixels.len()]);
    for (((pixel, r), g), b) in pixels.iter().zip(r).zip(g).zip(b) {
        [*r, *g, *b] = *pixel;
    }
}

/// [`Display::encode`] of pixels whose channels are all as long as the first. The arithmetic is that of IEEE 754 with any
/// instructions: all processors agree to the bit.
#[inline(always)]
pub(crate) fn encode_channels(display: &Display, [r, g, b]: [&mut [f32]; 3]) {
    let pixels = r.iter_mut().zip(g).zip(b);
    if let Curve::Custom(_) = display.curve {
        pixels.for_each(|((r, g), b)| [*r, *g, *b] = display.encode([*r, *g, *b]));
        return;
    }
    for ((r, g), b) in pixels {
        [*r, *g, *b] = display.encode_plain([*r, *g, *b]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn known_values() {
        assert_eq!(srgb_encode(0.0), 0.0);
        assert!((srgb_encode(1.0) - 1.0).abs() < 1e-6);
        assert!((srgb_encode(0.5) - 0.735_357).abs() < 1e-5);
        // Burns out at the white point: L = white ⇒ L_d = 1.
        let display = Display { exposure: 1.0, curve: Curve::Reinhard { white: Some(3.0) } };
        assert!((display.map([3.0; 3])[0] - 1.0).abs() < 1e-6);
        assert!((Display::SRGB.luma([1.0; 3]) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_curve_of_the_caller_s_own_shows_what_it_says() {
        let curve = ToneCurve::new(b"root", |exposed| exposed.map(f32::sqrt));
        let tone = ToneMapping::Custom { exposure: 4.0, curve: curve.clone() };
        assert_eq!(tone.check(), Ok(()));
        let display = tone.settle(&[[7.0; 3]]);
        // √(4·0.0625) = ½ on the screen, and 1 from 0.25
        assert_eq!(display.encode([0.0625, 0.25, -1.0]), [0.5, 1.0, 0.0]);
        assert!((display.luma([0.0625; 3]) - 0.5).abs() < 1e-6);
        assert!((display.map([0.0625; 3])[0] - srgb_decode(0.5)).abs() < 1e-6);
        assert_eq!(display.encode([f32::INFINITY, f32::NAN, f32::MAX]), [1.0, 0.0, 1.0]);
        assert!(ToneMapping::Custom { exposure: 0.0, curve }.check().is_err());
    }

    /// The operator that a picture settles, given to another picture, shows that one as the first.
    #[test]
    fn a_given_exposure_is_that_of_another_picture() {
        let (first, second) = ([[0.5_f32; 3], [2.0; 3]], [[0.6_f32; 3], [2.2; 3]]);
        let settled = ToneMapping::Reinhard { key: 0.18, white: Some(3.0) }.settle(&first);
        let given = ToneMapping::ReinhardAt { exposure: settled.exposure(), white: Some(3.0) };
        assert_eq!(given.check(), Ok(()));
        assert_eq!(given.settle(&second), settled);
        let error =
            |exposure| ToneMapping::ReinhardAt { exposure, white: None }.check().unwrap_err().to_string();
        assert!(error(0.0).starts_with("the exposure of Reinhard"), "{}", error(0.0));
        assert!(error(f32::NAN).contains("NaN"));
    }

    #[test]
    fn log_average_of_known_pictures() {
        let two = [[0.1_f32; 3], [10.0; 3]];
        assert!((log_average(&two).unwrap() - 1.0).abs() < 1e-2);
        let on_black = [[0.1_f32; 3], [0.0; 3], [10.0; 3], [0.0; 3], [-1.0; 3]];
        assert_eq!(log_average(&on_black), log_average(&two));
        assert_eq!(log_average(&[[0.0; 3]; 5]), None);
        assert_eq!(log_average(&[[f32::NAN; 3]]), None);
    }

    #[test]
    fn exposure_does_not_depend_on_the_unit_of_radiance() {
        let picture: Vec<Rgb> = (0..100).map(|i| [i as f32 / 50.0, 0.3, 0.1]).collect();
        let tone = ToneMapping::default();
        for unit in [1e-6_f32, 1.0, 1e6] {
            let scaled: Vec<Rgb> = picture.iter().map(|p| p.map(|c| c * unit)).collect();
            let (a, b) = (tone.settle(&picture), tone.settle(&scaled));
            for (p, s) in picture.iter().zip(&scaled) {
                assert!((a.luma(*p) - b.luma(*s)).abs() < 1e-5, "unit {unit}");
            }
        }
    }

    #[test]
    fn the_polynomial_is_the_formula() {
        let srgb_formula =
            |x: f64| if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        let worst = (0..1_000_000)
            .map(|i| i as f32 / 1e6)
            .map(|x| (f64::from(srgb_encode(x)) - srgb_formula(f64::from(x))).abs())
            .fold(0.0, f64::max);
        assert!(worst < 1e-6, "{worst}");
        assert_eq!((srgb_encode(-1.0), srgb_encode(f32::NAN).is_nan()), (0.0, true));
    }

    /// With whatever instructions this processor has.
    #[test]
    fn rows_of_pixels_are_pixels_to_the_bit() {
        let radiance = |i: usize| (i as f32 * 0.618).fract().powi(5) * 8.0 - 0.01;
        for width in [1, 7, 8, 127, 128, 129, 300] {
            let row: Vec<Rgb> =
                (0..width).map(|i| [radiance(i), radiance(2 * i + 1), radiance(3 * i + 5)]).collect();
            let curve = ToneCurve::new(b"root", |exposed| exposed.map(f32::sqrt));
            let custom = ToneMapping::Custom { exposure: 2.0, curve };
            for tone in [ToneMapping::default(), ToneMapping::Srgb { exposure: 2.0 }, custom] {
                let display = tone.settle(&row);
                let mut channels = [[0.0; 300]; 3];
                split_channels(&row, &mut channels);
                encode_channels(&display, channels.each_mut().map(|channel| &mut channel[..width]));
                for (i, &pixel) in row.iter().enumerate() {
                    assert_eq!(channels.map(|channel| channel[i]), display.encode(pixel), "{width} pixels");
                }
            }
        }
    }

    #[test]
    fn every_number_has_a_place_on_the_screen() {
        let curves = [None, Some(3.0), Some(1e-30), Some(1e30)].map(|white| Curve::Reinhard { white });
        for curve in curves.into_iter().chain([Curve::Clamp]) {
            for exposure in [1e-30, 1.0, 1e30] {
                for value in [-0.0, 1e-45, f32::MIN_POSITIVE, f32::MAX, -f32::MAX, -1.0] {
                    let shown = Display { exposure, curve: curve.clone() }.luma([value; 3]);
                    assert!((0.0..=1.0 + 1e-6).contains(&shown), "{curve:?}, {exposure}, {value}: {shown}");
                    assert!(value > 0.0 || shown == 0.0, "{curve:?}, {exposure}, {value}: {shown}");
                }
                // Red stays red
                let red = Display { exposure, curve: curve.clone() }.encode([1.0, 0.0, 0.0]);
                assert_eq!((red[1], red[2]), (0.0, 0.0), "{curve:?}, {exposure}");
            }
        }
    }

    proptest! {
        #[test]
        fn stays_in_range_and_grows_with_radiance(l in 0.0f32..1e30, more in 1.0f32..10.0, reinhard: bool) {
            let curve = if reinhard { Curve::Reinhard { white: None } } else { Curve::Clamp };
            let display = Display { exposure: 1.0, curve };
            let (a, b) = (display.luma([l; 3]), display.luma([l * more; 3]));
            prop_assert!((0.0..=1.000_001).contains(&a) && a <= b + 1e-6, "{a} {b}");
        }

        #[test]
        fn srgb_inverts(x in 0.0f32..1.0) {
            prop_assert!((srgb_decode(srgb_encode(x)) - x).abs() < 2e-6);
        }
    }
}
