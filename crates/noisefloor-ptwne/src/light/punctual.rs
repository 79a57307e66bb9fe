//! Lights without size.

use super::emitter::{Light, LightShape};
use crate::checks::{check_radiance, direction, position};
use crate::error::SceneError;
use noisefloor::Rgb;

/// A light without size.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Punctual {
    /// A point that shines equally in all directions.
    Point {
        /// Position, in scene units.
        position: [f32; 3],
        /// Radiant intensity (power per solid angle), 0…1e12.
        intensity: Rgb,
    },
    /// A point that shines into a cone, with the falloff of glTF's `KHR_lights_punctual`.
    Spot {
        /// Position, in scene units.
        position: [f32; 3],
        /// Direction in which it shines; need not have length 1.
        direction: [f32; 3],
        /// Radiant intensity along the direction, 0…1e12.
        intensity: Rgb,
        /// Half angle in degrees up to which the intensity is constant, 0…90.
        inner: f32,
        /// Half angle in degrees beyond which the light is dark: above `inner`, up to 90.
        outer: f32,
    },
    /// Parallel light from infinitely far away.
    Distant {
        /// Direction in which the light travels; need not have length 1.
        direction: [f32; 3],
        /// Irradiance of a surface that faces it, 0…1e12.
        irradiance: Rgb,
    },
}

impl Light {
    /// # Errors
    /// [`SceneError`] if a number is not finite or out of range, or a direction is zero.
    pub(crate) fn punctual(punctual: Punctual) -> Result<Self, SceneError> {
        let (shape, radiance) = match punctual {
            Punctual::Point { position: p, intensity } => {
                // A cone that contains all directions
                let position = position(p)?.into();
                let axis = crate::math::Vec3::Z;
                (LightShape::Point { position, axis, inner: -2.0, outer: -3.0 }, intensity)
            }
            Punctual::Spot { position: p, direction: d, intensity, inner, outer } => {
                if !(0.0 <= inner && inner < outer && outer <= 90.0) {
                    let (what, range) =
                        ("the outer angle of a spot", "above the inner one, up to 90 degrees");
                    return Err(SceneError::Range { what, value: outer, range });
                }
                let (inner, outer) = (inner.to_radians().cos(), outer.to_radians().cos());
                let position = position(p)?.into();
                (LightShape::Point { position, axis: direction(d)?, inner, outer }, intensity)
            }
            Punctual::Distant { direction: d, irradiance } => {
                (LightShape::Distant { towards: -direction(d)? }, irradiance)
            }
        };
        check_radiance(radiance)?;
        Ok(Self::new(shape, radiance.into()))
    }
}
