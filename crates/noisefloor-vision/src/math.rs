//! Logarithms and powers that compile to vector instructions, with the same bits on every processor.
//!
//! The standard library calls the platform's `powf`, one number at a time. A tile needs 100,000 powers, so
//! these are polynomials instead: within 3·10⁻⁶ of the exact value, for the ranges that vision needs.

use std::f32::consts::{LN_2, LOG2_E, SQRT_2};

/// log₂ of a positive, finite number, within 2·10⁻⁶. Zero, subnormal and negative numbers give no meaningful
/// number, but a finite one.
#[inline(always)]
pub(crate) fn log2(x: f32) -> f32 {
    // x = 2^e · m with m in [√½, √2)
    let bits = x.to_bits() & 0x7fff_ffff;
    let shifted = bits.wrapping_sub((SQRT_2 / 2.0).to_bits());
    let exponent = (shifted as i32) >> 23;
    let m = f32::from_bits(bits.wrapping_sub((exponent as u32) << 23));
    // ln m = 2·artanh(s) with s = (m − 1)/(m + 1); |s| < 0.172, so the next term is below 10⁻⁹
    let s = (m - 1.0) / (m + 1.0);
    let s2 = s * s;
    let series = 1.0 + s2 * (1.0 / 3.0 + s2 * (1.0 / 5.0 + s2 * (1.0 / 7.0 + s2 * (1.0 / 9.0))));
    exponent as f32 + s * series * (2.0 * LOG2_E)
}

/// 2^x within 3·10⁻⁷ of it; x is held within [−126, 127].
#[inline(always)]
pub(crate) fn exp2(x: f32) -> f32 {
    // Adding 1.5·2²³ leaves the nearest integer in the lowest bits
    const ROUND: f32 = 12_582_912.0;
    let x = if x > -126.0 { x } else { -126.0 };
    let x = if x < 127.0 { x } else { 127.0 };
    let shifted = x + ROUND;
    let t = (x - (shifted - ROUND)) * LN_2;
    let series = 1.0
        + t * (1.0
            + t * (1.0 / 2.0 + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t * (1.0 / 120.0 + t * (1.0 / 720.0))))));
    // Multiplies by 2^integer through the exponent
    f32::from_bits(series.to_bits().wrapping_add(shifted.to_bits() << 23))
}

/// x^p of a positive, finite number.
#[inline(always)]
pub(crate) fn pow(x: f32, p: f32) -> f32 {
    exp2(p * log2(x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn known_values() {
        for (x, log) in [(1.0, 0.0), (2.0, 1.0), (0.125, -3.0), (1024.0, 10.0)] {
            assert_eq!(log2(x), log);
            assert_eq!(exp2(log), x);
        }
        assert!((pow(0.5, 2.4) - 0.189_464_57).abs() < 1e-7);
    }

    #[test]
    fn whatever_comes_gives_finite_numbers() {
        for x in [0.0, -0.0, -1.0, 1e-45, f32::MAX, f32::MIN_POSITIVE] {
            assert!(log2(x).is_finite(), "{x}");
            assert!(exp2(x).is_finite(), "{x}");
        }
    }

    proptest! {
        #[test]
        fn as_the_standard_library(x in 1e-6f32..1e6, p in 0.05f32..4.0) {
            let exact = f64::from(x).powf(f64::from(p));
            prop_assert!((f64::from(log2(x)) - f64::from(x).log2()).abs() < 2e-6);
            if (1e-30..1e30).contains(&exact) {
                prop_assert!((f64::from(pow(x, p)) / exact - 1.0).abs() < 1e-5, "{} {}", pow(x, p), exact);
            }
        }
    }
}
