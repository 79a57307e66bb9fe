//! Cones of directions that fade towards their edge.

use crate::error::SceneError;

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

/// A cone of directions that fades towards its edge, given by cosines.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    pub(super) inner: f32,
    pub(super) outer: f32,
    pub(super) falloff: Falloff,
}

impl Cone {
    pub(super) const EVERYWHERE: Self = Self { inner: -2.0, outer: -3.0, falloff: Falloff::Squared };

    pub(super) fn new(inner: f32, outer: f32, falloff: Falloff) -> Result<Self, SceneError> {
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
