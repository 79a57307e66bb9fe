//! Lights without size.

use super::emitter::{Light, LightShape, Projection};
use crate::checks::{check_radiance, check_range, direction, position};
use crate::error::SceneError;
use noisefloor::Rgb;

/// How a spot fades from its inner angle to its outer one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Falloff {
    /// By the square of the cosine's way between both: glTF's `KHR_lights_punctual`.
    #[default]
    Squared,
    /// By the angle: Mitsuba's.
    Linear,
    /// By 3x² − 2x³ of the cosine's way x between both: that of pbrt-v4.
    Smooth,
    /// By the fourth power of the cosine's way between both: that of pbrt-v3.
    Fourth,
}

/// How the intensity of a projector depends on the angle θ to its axis, besides the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Profile {
    /// As 1/cos³ θ, so that a plane across the axis is lit evenly: Mitsuba's projectors.
    #[default]
    EvenPlane,
    /// Not at all: pbrt's projectors.
    Even,
    /// As a spot fades: half angles in degrees as in [`Punctual::Spot`], and how it fades between them.
    Spot {
        /// Half angle in degrees up to which the intensity is constant, 0…90.
        inner: f32,
        /// Half angle in degrees beyond which the light is dark: above `inner`, up to 90.
        outer: f32,
        /// How it fades between both.
        falloff: Falloff,
    },
}

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
    /// A point that shines into a cone.
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
        /// How it fades between both.
        falloff: Falloff,
    },
    /// A point that projects a picture ([`SceneBuilder::projector`](crate::SceneBuilder::projector)).
    Projector {
        /// Position, in scene units.
        position: [f32; 3],
        /// Directions in which the picture's u and v grow, and in which it shines, each of length 1 and
        /// perpendicular to the others.
        axes: [[f32; 3]; 3],
        /// Tangents of the half angles that the picture covers along u and v: above 0, up to 10⁴. It is dark
        /// outside.
        extent: [f32; 2],
        /// Radiant intensity along the axis where the picture is 1, 0…1e12.
        intensity: Rgb,
        /// How the intensity depends on the angle.
        profile: Profile,
    },
    /// Parallel light from infinitely far away.
    Distant {
        /// Direction in which the light travels; need not have length 1.
        direction: [f32; 3],
        /// Irradiance of a surface that faces it, 0…1e12.
        irradiance: Rgb,
    },
}

/// A cone of directions that fades towards its edge, given by cosines.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    pub(super) inner: f32,
    pub(super) outer: f32,
    pub(super) falloff: Falloff,
}

impl Cone {
    /// Contains all directions.
    const EVERYWHERE: Self = Self { inner: -2.0, outer: -3.0, falloff: Falloff::Squared };

    fn new(inner: f32, outer: f32, falloff: Falloff) -> Result<Self, SceneError> {
        if !(0.0 <= inner && inner < outer && outer <= 90.0) {
            let (what, range) = ("the outer angle of a spot", "above the inner one, up to 90 degrees");
            return Err(SceneError::Range { what, value: outer, range });
        }
        Ok(Self { inner: inner.to_radians().cos(), outer: outer.to_radians().cos(), falloff })
    }

    /// The factor on the intensity in a direction of cosine `cos` with the axis.
    #[inline]
    pub(super) fn fade(&self, cos: f32) -> f32 {
        let x = ((cos - self.outer) / (self.inner - self.outer)).clamp(0.0, 1.0);
        match self.falloff {
            Falloff::Squared => x * x,
            Falloff::Smooth => x * x * (3.0 - 2.0 * x),
            Falloff::Fourth => x * x * x * x,
            Falloff::Linear if x <= 0.0 || x >= 1.0 => x,
            Falloff::Linear => {
                let [inner, outer, angle] = [self.inner, self.outer, cos].map(f32::acos);
                ((outer - angle) / (outer - inner)).clamp(0.0, 1.0)
            }
        }
    }
}

fn projector(
    at: [f32; 3],
    axes: [[f32; 3]; 3],
    extent: [f32; 2],
    profile: Profile,
) -> Result<LightShape, SceneError> {
    let [u, v, axis] = [direction(axes[0])?, direction(axes[1])?, direction(axes[2])?];
    for value in extent {
        check_range("the extent of a projector", value, [1e-6, 1e4], "1e-6…1e4")?;
    }
    let projection = match profile {
        Profile::EvenPlane => Projection::EvenPlane,
        Profile::Even => Projection::Cone(Cone::EVERYWHERE),
        Profile::Spot { inner, outer, falloff } => Projection::Cone(Cone::new(inner, outer, falloff)?),
    };
    let position = position(at)?.into();
    Ok(LightShape::Projector { position, u: u / extent[0], v: v / extent[1], axis, projection })
}

impl Light {
    /// # Errors
    /// [`SceneError`] if a number is not finite or out of range, or a direction is zero.
    pub(crate) fn punctual(punctual: Punctual) -> Result<Self, SceneError> {
        let (shape, radiance) = match punctual {
            Punctual::Point { position: p, intensity } => {
                let position = position(p)?.into();
                let (axis, cone) = (crate::math::Vec3::Z, Cone::EVERYWHERE);
                (LightShape::Point { position, axis, cone }, intensity)
            }
            Punctual::Spot { position: p, direction: d, intensity, inner, outer, falloff } => {
                let cone = Cone::new(inner, outer, falloff)?;
                let position = position(p)?.into();
                (LightShape::Point { position, axis: direction(d)?, cone }, intensity)
            }
            Punctual::Projector { position: p, axes, extent, intensity, profile } => {
                (projector(p, axes, extent, profile)?, intensity)
            }
            Punctual::Distant { direction: d, irradiance } => {
                (LightShape::Distant { towards: -direction(d)? }, irradiance)
            }
        };
        check_radiance(radiance)?;
        Ok(Self::new(shape, radiance.into()))
    }
}
