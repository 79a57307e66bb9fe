//! A smooth sky and its sun.

use crate::checks::check_radiance;
use crate::error::SceneError;
use crate::math::Vec3;
use noisefloor::Rgb;

/// A sky: a smooth dome and an optional sun. Up is +y. Linear radiance, at any non-negative scale.
///
/// The dome is found by scattered rays only, since it is too smooth for light sampling to help. The sun is a
/// light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Environment {
    /// Radiance straight up.
    pub zenith: Rgb,
    /// Radiance at the horizon. Above it, the dome blends to the zenith with the square root of the height.
    pub horizon: Rgb,
    /// Radiance from below.
    pub ground: Rgb,
    pub sun: Option<Sun>,
}

/// A bright disc in the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Direction towards the sun; need not have length 1.
    pub direction: [f32; 3],
    /// Half of the disc's apparent diameter in degrees, 0.01…30. As seen from Earth: 0.27.
    pub angular_radius: f32,
    /// Radiance of the disc, added to the dome's.
    pub radiance: Rgb,
}

impl Environment {
    /// The same radiance from all directions.
    pub fn constant(radiance: Rgb) -> Self {
        Self { zenith: radiance, horizon: radiance, ground: radiance, sun: None }
    }

    pub(crate) fn check(&self) -> Result<(), SceneError> {
        [self.zenith, self.horizon, self.ground].into_iter().try_for_each(check_radiance)?;
        let Some(sun) = self.sun else { return Ok(()) };
        check_radiance(sun.radiance)?;
        if !sun.direction.iter().all(|x| x.is_finite()) || sun.direction == [0.0; 3] {
            return Err(SceneError::NotFinite { what: "the direction of the sun" });
        }
        if !(0.01..=30.0).contains(&sun.angular_radius) {
            let what = "the angular radius of the sun";
            return Err(SceneError::Range { what, value: sun.angular_radius, range: "0.01…30 degrees" });
        }
        Ok(())
    }
}

/// The dome, ready for the inner loop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dome {
    zenith: Vec3,
    horizon: Vec3,
    ground: Vec3,
}

impl Dome {
    pub(crate) fn is_black(&self) -> bool {
        self.zenith.max(self.horizon).max(self.ground) == Vec3::ZERO
    }

    pub(crate) fn new(environment: &Environment) -> Self {
        Self {
            zenith: Vec3::from_array(environment.zenith),
            horizon: Vec3::from_array(environment.horizon),
            ground: Vec3::from_array(environment.ground),
        }
    }

    /// Radiance of the dome from `dir`.
    #[inline]
    pub(crate) fn radiance(&self, dir: Vec3) -> Vec3 {
        if dir.y >= 0.0 {
            self.horizon.lerp(self.zenith, dir.y.sqrt().min(1.0))
        } else {
            // A short blend below the horizon hides the edge
            self.horizon.lerp(self.ground, (dir.y * -12.0).min(1.0))
        }
    }
}
