//! Light that reaches a point of the scene: from its emitters, and from what surrounds it.

use crate::accel::Hit;
use crate::geometry::NO;
use crate::intersection::Intersection;
use crate::light::{Light, LightSample, LightShape};
use crate::math::Vec3;
use crate::scene::{Scene, Sky};
use crate::texture::{Texture, twice};

/// Light that a ray hit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Emitted<'a> {
    pub(crate) radiance: Vec3,
    pub(crate) light: &'a Light,
    /// Cosine between the ray and the light's normal.
    pub(crate) cos: f32,
}

impl Scene {
    /// Radiance from `dir` of what is infinitely far away. `weight` is the weight of light that is also
    /// sampled, by the index of its light and the density of the sample given the light.
    #[inline]
    pub(crate) fn background(&self, dir: Vec3, weight: impl FnOnce(usize, f32) -> f32) -> Vec3 {
        match &self.sky {
            None => Vec3::ZERO,
            // The map is the last light
            Some(Sky::Map(map)) => map.radiance(dir) * weight(self.lights.all.len() - 1, map.pdf(dir)),
            Some(Sky::Dome(dome)) => {
                let mut sum = dome.radiance(dir);
                if let Some(index) = self.sun
                    && self.lights.all[index].covers(dir)
                {
                    let sun = &self.lights.all[index];
                    sum += sun.radiance * weight(index, sun.pdf(Vec3::ZERO, 0.0, 1.0));
                }
                sum
            }
        }
    }

    /// The light of a surface towards the origin of the ray along `dir` that hit it; none if it does not
    /// shine there.
    #[inline]
    pub(crate) fn emitted(&self, surface: &Intersection<'_>, hit: &Hit, dir: Vec3) -> Option<Emitted<'_>> {
        if surface.light == NO {
            return None;
        }
        let light = &self.lights.all[surface.light as usize];
        let cos = -dir.dot(surface.flat) * if surface.front { 1.0 } else { -1.0 };
        let factor = self.emission_factor(light, hit.uv);
        light.shines(cos).then_some(Emitted { radiance: light.radiance * factor, light, cos })
    }

    /// A sample of `light` as seen from `from`; see [`Light::sample`].
    #[inline]
    pub(crate) fn sample_light(&self, light: &Light, from: Vec3, u: [f32; 3]) -> Option<LightSample> {
        let mut sample = light.sample(from, u, self.map())?;
        if light.texture != NO {
            sample.value *= self.emission_factor(light, sample.uv);
        }
        Some(sample)
    }

    /// The factor that [`LightSample::value`] lacks until the light is known to be visible.
    #[inline]
    pub(crate) fn deferred_radiance(&self, light: &Light, dir: Vec3) -> Vec3 {
        match (&light.shape, self.map()) {
            (LightShape::Map, Some(map)) => map.radiance(dir),
            _ => Vec3::ONE,
        }
    }

    /// The emission texture of `light` at `uv` along its edges; one if it has none.
    #[inline]
    fn emission_factor(&self, light: &Light, uv: [f32; 2]) -> Vec3 {
        match self.emission_textures.get(light.texture as usize) {
            None => Vec3::ONE,
            // The picture of a projector
            Some(texture) if light.prim == NO => texture.eval(twice(uv)),
            Some(texture) => {
                let group = self.geometry.group(light.prim);
                let factor = texture.eval(self.geometry.texture_coordinates(group, light.prim, uv));
                match texture {
                    Texture::Corners(_) if group.colours != NO => {
                        factor * self.geometry.tint(group, light.prim, uv)
                    }
                    _ => factor,
                }
            }
        }
    }
}
