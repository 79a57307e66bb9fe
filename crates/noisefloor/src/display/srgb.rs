//! The encoding of sRGB, and its inverse.

/// sRGB encoding of one linear channel (IEC 61966-2-1): [0, 1] → [0, 1], clamped; NaN stays NaN.
///
/// The curve is a polynomial of the fourth root, within 10⁻⁶ of the formula: without a table or a power, the
/// compiler can encode many channels at once. Every verdict encodes each pixel nine times.
#[inline(always)]
pub fn srgb_encode(linear: f32) -> f32 {
    let linear = linear.clamp(0.0, 1.0);
    let root = linear.sqrt().sqrt();
    let curve = CURVE.iter().rev().fold(0.0, |sum, &coefficient| sum * root + coefficient);
    if linear <= 0.003_130_8 { 12.92 * linear } else { curve }
}

/// 1.055·t^(5/3) − 0.055 for t from 0.0031308^(1/4) to 1, within 3.2·10⁻⁷ before rounding: the polynomial of
/// seventh degree with the least error, lowest power first.
const CURVE: [f32; 8] = [
    -0.058_446_594,
    0.123_575_896,
    1.461_525_8,
    -1.155_896_1,
    1.209_151,
    -0.898_413_9,
    0.394_713_85,
    -0.076_210_424,
];

/// Inverse of [`srgb_encode`]: [0, 1] → [0, 1], clamped.
#[inline]
pub fn srgb_decode(encoded: f32) -> f32 {
    let x = encoded.clamp(0.0, 1.0);
    if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}
