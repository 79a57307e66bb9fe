//! Lights without size.

use super::cone::{Cone, Falloff};
use super::emitter::{Light, LightShape, Projection};
use crate::checks::{check_radiance, check_range, direction, position};
use crate::error::SceneError;
use noisefloor::Rgb;

/// How the intensity of a projector depends on the angle θ to its axis, besides the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Profile {
    /// As 1/cos³ θ, so that a plane across the axis is lit evenly: Mitsuba's projectors.
    #[default]
    EvenPlane,
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
        Profile::Spot { inner, outer, falloff } => Projection::Cone(Cone::new(inner, outer, falloff)?),
    };
    let position = position(at)?.into();
    Ok(LightShape::Projector { position, u: u / extent[0], v: v / extent[1], axis, projection })
}

impl Light {
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
