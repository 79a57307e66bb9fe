//! Checks of the numbers that a scene is made of.

use crate::error::SceneError;
use crate::math;
use glam::Vec3;
use noisefloor::Rgb;

/// Largest absolute value of a coordinate: the squared area of a parallelogram, 10³⁴, and sums of such
/// stay far from the limits of `f32`. What is smaller than 10⁻⁶ of the scene is lost in its offsets long
/// before.
pub const MAX_COORDINATE: f32 = 1e8;
/// Largest radiance that is accepted: sums of products stay far from the limits of `f32`.
pub(crate) const MAX_RADIANCE: f32 = 1e12;

/// Checks that a radiance is finite and not negative.
pub(crate) fn check_radiance(radiance: Rgb) -> Result<(), SceneError> {
    check_channels(radiance, "a radiance", MAX_RADIANCE, "0…1e12")
}

/// Checks that a reflectance is in 0…1.
pub(crate) fn check_reflectance(colour: Rgb) -> Result<(), SceneError> {
    check_channels(colour, "a reflectance", 1.0, "0…1")
}

fn check_channels(
    channels: Rgb,
    what: &'static str,
    most: f32,
    range: &'static str,
) -> Result<(), SceneError> {
    for value in channels {
        if !value.is_finite() {
            return Err(SceneError::NotFinite { what });
        }
        if !(0.0..=most).contains(&value) {
            return Err(SceneError::Range { what, value, range });
        }
    }
    Ok(())
}

/// Checks that a number is in `low`…`high`; NaN is not.
pub(crate) fn check_range(
    what: &'static str,
    value: f32,
    [low, high]: [f32; 2],
    range: &'static str,
) -> Result<(), SceneError> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(SceneError::Range { what, value, range }) }
}

/// A checked position, edge or normal.
pub(crate) fn position(p: [f32; 3]) -> Result<Vec3, SceneError> {
    for value in p {
        if !value.is_finite() {
            return Err(SceneError::NotFinite { what: "a position or normal" });
        }
        if value.abs() > MAX_COORDINATE {
            return Err(SceneError::Range { what: "a position or normal", value, range: "−1e8…1e8" });
        }
    }
    Ok(p.into())
}

/// A direction, of length 1.
pub(crate) fn direction(d: [f32; 3]) -> Result<math::Vec3, SceneError> {
    // In f64, since the squared length of a short vector vanishes in f32
    let unit = Vec3::from(d).as_dvec3().try_normalize();
    unit.map(|d| d.as_vec3a()).ok_or(SceneError::NotFinite { what: "the direction of a light" })
}

/// Makes room for `more` elements, or says that there is no memory for them.
pub(crate) fn room<T>(elements: &mut Vec<T>, more: usize) -> Result<(), SceneError> {
    let bytes = (elements.len() + more).saturating_mul(size_of::<T>());
    elements.try_reserve(more).map_err(|_| SceneError::Memory { bytes })
}

/// Checks that there is memory for `bytes`, before what cannot say so needs it.
pub fn check_memory(bytes: usize) -> Result<(), SceneError> {
    Vec::<u8>::new().try_reserve_exact(bytes).map_err(|_| SceneError::Memory { bytes })
}
