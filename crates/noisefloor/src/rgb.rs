//! The one pixel type.

/// Linear RGB radiance of one pixel, Rec.709 primaries, arbitrary scale; display values in [0, 1] where a
/// name says so.
pub type Rgb = [f32; 3];
