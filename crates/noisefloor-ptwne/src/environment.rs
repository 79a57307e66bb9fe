//! Light from infinitely far away.

use crate::error::SceneError;
use crate::math::Vec3;
use noisefloor::Rgb;

/// A sky: a smooth dome and, if wanted, a sun. Up is +y. Linear radiance, any non-negative scale.
///
/// The dome is gathered by scattered rays alone (it is too smooth for light sampling to help); the sun is a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Environment {
    /// Radiance straight up.
    pub zenith: Rgb,
    /// Radiance at the horizon. Above it the dome blends to the zenith with the square root of the height.
    pub horizon: Rgb,
    /// Radiance from below.
    pub ground: Rgb,
    /// The sun.
    pub sun: Option<Sun>,
}

/// A disc of light in the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Direction towards the sun; need not have length 1.
    pub direction: [f32; 3],
    /// Half of the disc's apparent diameter in degrees, 0.01…30. Seen from the earth: 0.27.
    pub angular_radius: f32,
    /// Radiance of the disc, added to the dome's.
    pub radiance: Rgb,
}

/// Checks that a radiance is finite and not negative.
pub(crate) fn check_radiance(radiance: Rgb) -> Result<(), SceneError> {
    for value in radiance {
        if !value.is_finite() {
            return Err(SceneError::NotFinite { what: "a radiance" });
        }
        if !(0.0..=MAX_RADIANCE).contains(&value) {
            return Err(SceneError::Range { what: "a radiance", value, range: "0…1e12" });
        }
    }
    Ok(())
}

/// Largest radiance that is accepted: sums of products stay far from the limits of f32.
pub(crate) const MAX_RADIANCE: f32 = 1e12;

impl Environment {
    /// The same radiance from everywhere.
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
