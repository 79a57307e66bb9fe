//! What passes for rounding, and what passes for chance.

/// Relative differences below this are rounding and not noise: about 64 roundings to f32.
pub(super) const ROUNDING: f64 = 64.0 / (1 << 24) as f64;
/// Largest number of standard errors that passes for chance.
pub(super) const LARGEST_Z: f64 = 6.0;
