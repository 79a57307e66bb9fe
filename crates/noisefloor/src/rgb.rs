//! The one pixel type.

/// Linear RGB radiance of one pixel, Rec.709 primaries, arbitrary scale; display values in [0, 1] where a
/// name says so.
pub type Rgb = [f32; 3];

/// Rec.709 luminance of a linear RGB triple, in the unit of its input.
#[inline(always)]
pub fn luminance([r, g, b]: Rgb) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Luminance weights, squared and summed: variance of Y′ for unit variance of R′, G′ and B′.
pub const ROUNDING_LUMINANCE: f32 = 0.2126 * 0.2126 + 0.7152 * 0.7152 + 0.0722 * 0.0722;
