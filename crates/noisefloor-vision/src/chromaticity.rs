//! The colours of a display: chromaticities of its primaries and its white → linear RGB to CIE XYZ.

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What colours a display mixes from: CIE 1931 chromaticities, each x and y.
///
/// ```
/// use noisefloor_vision::{Chromaticities, Primaries, Viewing};
///
/// let proof = Chromaticities { white: Chromaticities::D50, ..Chromaticities::REC709 };
/// let mut params = Viewing::default().params();
/// params.primaries = Primaries::Measured(proof);
/// assert_eq!(params.check()?, "desk,white=d50".parse()?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Chromaticities {
    /// Of red.
    pub red: [f64; 2],
    /// Of green.
    pub green: [f64; 2],
    /// Of blue.
    pub blue: [f64; 2],
    /// Of white: all three primaries at their highest.
    pub white: [f64; 2],
}

/// Chromaticities that no display has.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ChromaticityError {
    /// Out of range.
    #[error("no light has the chromaticity {x}:{y}: CIE 1931 x must lie within 0…1, y within 0.0001…1")]
    Coordinates {
        /// The first coordinate.
        x: f64,
        /// The second coordinate.
        y: f64,
    },
    /// The primaries lie nearly on a line, or run clockwise.
    #[error(
        "red, green and blue must span a triangle, counterclockwise: check for two that are swapped or equal"
    )]
    Triangle,
    /// Some primary would need a luminance below zero.
    #[error(
        "the white {x}:{y} must lie inside the triangle of red, green and blue: \
         give the white that this display shows, or other primaries"
    )]
    White {
        /// Its x.
        x: f64,
        /// Its y.
        y: f64,
    },
}

/// Twice the area of the thinnest triangle of primaries; that of Rec.709 has 0.224.
const THINNEST: f64 = 0.001;

impl Chromaticities {
    /// ITU-R BT.709 and sRGB, with a white of D65.
    pub const REC709: Self =
        Self { red: [0.64, 0.33], green: [0.30, 0.60], blue: [0.15, 0.06], white: Self::D65 };
    /// ITU-R BT.2020, with a white of D65.
    pub const REC2020: Self =
        Self { red: [0.708, 0.292], green: [0.170, 0.797], blue: [0.131, 0.046], white: Self::D65 };
    /// Display P3: the primaries of SMPTE RP 431-2, with a white of D65 (SMPTE EG 432-1).
    pub const DISPLAY_P3: Self =
        Self { red: [0.680, 0.320], green: [0.265, 0.690], blue: [0.150, 0.060], white: Self::D65 };

    /// The white of prepress; illuminants have the four digits that standards of displays give them.
    pub const D50: [f64; 2] = [0.3457, 0.3585];
    /// Daylight of 5503 K.
    pub const D55: [f64; 2] = [0.3324, 0.3474];
    /// The white of sRGB, BT.709 and BT.2020.
    pub const D65: [f64; 2] = [0.3127, 0.3290];
    /// Daylight of 7504 K.
    pub const D75: [f64; 2] = [0.2990, 0.3149];
    /// The white of broadcast in Japan, and of many screens as they are sold.
    pub const D93: [f64; 2] = [0.2831, 0.2971];

    /// Chromaticity of daylight of this correlated colour temperature, 4000…25000 K; `None` outside
    /// (CIE 15:2018, §4.1.2). D65 is daylight of 6504 K, D50 of 5003 K: both were named before the constant
    /// of radiation that defines the temperature was changed.
    pub fn daylight(kelvin: f64) -> Option<[f64; 2]> {
        let t = 1000.0 / kelvin;
        let x = match kelvin {
            4000.0..=7000.0 => 0.244_063 + t * (0.099_11 + t * (2.9678 + t * -4.6070)),
            7000.0..=25_000.0 => 0.237_040 + t * (0.247_48 + t * (1.9018 + t * -2.0064)),
            _ => return None,
        };
        Some([x, -3.000 * x * x + 2.870 * x - 0.275])
    }

    /// The matrix from linear RGB to CIE XYZ, row by row; white has a Y of 1 (SMPTE RP 177).
    ///
    /// # Errors
    /// [`ChromaticityError`], unless a display with positive luminance of every primary shows this white.
    pub fn to_xyz(&self) -> Result<[[f64; 3]; 3], ChromaticityError> {
        let Self { red, green, blue, white } = *self;
        for [x, y] in [red, green, blue, white] {
            if !(0.0..=1.0).contains(&x) || !(0.0001..=1.0).contains(&y) {
                return Err(ChromaticityError::Coordinates { x, y });
            }
        }
        let whole = doubled_area(red, green, blue);
        if whole < THINNEST {
            return Err(ChromaticityError::Triangle);
        }
        // RP 177 inverts the matrix of the primaries and applies the inverse to white. As x + y + z = 1, what
        // comes out are the barycentric coordinates of white in the triangle, over white's y.
        let parts = [
            doubled_area(white, green, blue),
            doubled_area(red, white, blue),
            doubled_area(red, green, white),
        ];
        if parts.iter().any(|&part| part <= 0.0) {
            return Err(ChromaticityError::White { x: white[0], y: white[1] });
        }
        let sums = parts.map(|part| part / whole / white[1]);
        let primaries = [red, green, blue].map(|[x, y]| [x, y, 1.0 - x - y]);
        Ok(std::array::from_fn(|row| std::array::from_fn(|i| sums[i] * primaries[i][row])))
    }
}

/// Twice the area of a triangle, positive if its corners run counterclockwise.
fn doubled_area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn largest_difference(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> f64 {
        let pairs = a.iter().flatten().zip(b.iter().flatten());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn published_matrices_come_out() {
        // IEC 61966-2-1, ITU-R BT.2020 to the digits of the standard, SMPTE EG 432-1
        let srgb = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
        let bt2020 = [[0.6370, 0.1446, 0.1689], [0.2627, 0.6780, 0.0593], [0.0000, 0.0281, 1.0610]];
        let p3 = [
            [0.486_570_95, 0.265_667_69, 0.198_217_29],
            [0.228_974_56, 0.691_738_52, 0.079_286_91],
            [0.0, 0.045_113_38, 1.043_944_37],
        ];
        for (colours, published, digits) in [
            (Chromaticities::REC709, srgb, 1e-4),
            (Chromaticities::REC2020, bt2020, 1e-4),
            (Chromaticities::DISPLAY_P3, p3, 1e-8),
        ] {
            let found = colours.to_xyz().unwrap();
            assert!(largest_difference(found, published) < digits, "{found:?}");
        }
    }

    #[test]
    fn daylight_is_that_of_the_illuminants() {
        // A nominal temperature times 1.4388/1.4380, the ratio of the second radiation constants. CIE 15 rounds
        // the coefficients of y to three decimals, which alone allows 7·10⁻⁴; D50 is off most, by 1.0·10⁻⁴.
        for (kelvin, white) in [
            (5000.0, Chromaticities::D50),
            (5500.0, Chromaticities::D55),
            (6500.0, Chromaticities::D65),
            (7500.0, Chromaticities::D75),
            (9300.0, Chromaticities::D93),
        ] {
            let [x, y] = Chromaticities::daylight(kelvin * 1.4388 / 1.4380).unwrap();
            assert!((x - white[0]).abs() < 1e-4 && (y - white[1]).abs() < 1.5e-4, "{kelvin}: {x}, {y}");
        }
        for kelvin in [3999.0, 25_001.0, f64::NAN, f64::INFINITY, -5000.0] {
            assert_eq!(Chromaticities::daylight(kelvin), None);
        }
        // Both polynomials meet
        let [below, above] = [7000.0, 7000.001].map(|kelvin| Chromaticities::daylight(kelvin).unwrap());
        assert!((below[0] - above[0]).abs() < 1e-4);
    }

    #[test]
    fn what_no_display_has_is_refused() {
        let rec709 = Chromaticities::REC709;
        for bad in [[f64::NAN, 0.3], [0.3, f64::INFINITY], [0.3, 0.0], [-0.1, 0.3], [0.3, 1.1]] {
            for colours in [Chromaticities { red: bad, ..rec709 }, Chromaticities { white: bad, ..rec709 }] {
                assert!(matches!(colours.to_xyz(), Err(ChromaticityError::Coordinates { .. })), "{bad:?}");
            }
        }
        let swapped = Chromaticities { red: rec709.green, green: rec709.red, ..rec709 };
        let equal = Chromaticities { red: rec709.green, ..rec709 };
        for colours in [swapped, equal] {
            assert_eq!(colours.to_xyz(), Err(ChromaticityError::Triangle));
        }
        for white in [[0.6, 0.5], [0.2, 0.6], [0.4, 0.1], rec709.red] {
            let refused = Chromaticities { white, ..rec709 }.to_xyz();
            assert_eq!(refused, Err(ChromaticityError::White { x: white[0], y: white[1] }));
        }
    }

    fn chromaticity() -> impl Strategy<Value = [f64; 2]> {
        [0.0f64..1.0, 0.0001f64..1.0]
    }

    proptest! {
        #[test]
        fn accepted_colours_have_positive_luminances_that_add_up_to_white(
            red in chromaticity(), green in chromaticity(), blue in chromaticity(),
            inside in [0.001f64..1.0, 0.001f64..1.0, 0.001f64..1.0],
        ) {
            let all: f64 = inside.iter().sum();
            let mixed = |i: usize| (inside[0] * red[i] + inside[1] * green[i] + inside[2] * blue[i]) / all;
            let white = [mixed(0), mixed(1)];
            let found = Chromaticities { red, green, blue, white }.to_xyz();
            // With a white inside, only the triangle can be wrong
            if doubled_area(red, green, blue) < THINNEST {
                prop_assert_eq!(found, Err(ChromaticityError::Triangle));
                return Ok(());
            }
            let [x, y, _] = found.unwrap();
            prop_assert!(y.iter().all(|&weight| weight > 0.0));
            prop_assert!((y.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            let [sum, expected] = [x.iter().sum::<f64>(), white[0] / white[1]];
            prop_assert!((sum - expected).abs() < 1e-9 * (1.0 + expected), "{sum} for {expected}");
        }

        #[test]
        fn whatever_comes_is_answered_with_finite_numbers_or_refused(
            numbers in proptest::array::uniform8(proptest::num::f64::ANY)
        ) {
            let [a, b, c, d, e, f, g, h] = numbers;
            let colours = Chromaticities { red: [a, b], green: [c, d], blue: [e, f], white: [g, h] };
            if let Ok(matrix) = colours.to_xyz() {
                prop_assert!(matrix.iter().flatten().all(|v| v.is_finite()));
            }
        }
    }
}
