//! A scene, ready to be rendered.

use crate::accel::{self, Bvh, Hierarchy, Hit, Surface};
use crate::camera::{Camera, Lens, Optics};
use crate::checks::check_memory;
use crate::environment::{Dome, Environment, Map};
use crate::error::SceneError;
use crate::geometry::Intersection;
use crate::geometry::{Geometry, NO};
use crate::light::{Light, LightSample, LightShape, Lights};
use crate::material::CompiledMaterial;
use crate::math::Vec3;
use crate::parts::{Object, Parts, Surroundings};
use crate::texture::{Texture, twice};
use noisefloor::source::SourceIdentity;
use std::ops::Range;

/// A scene whose centre is farther from the origin than this many of its radii is moved there: `f32` keeps 24
/// bits of each coordinate, and those that only say where the scene is are lost to its detail.
const FAR: f32 = 16.0;

/// Bytes that building the hierarchy takes for each surface and instance at most, besides the surfaces.
const BUILDING: usize = 320;

/// What surrounds a scene, prepared for lookup.
#[derive(Clone, Debug)]
pub(crate) enum Sky {
    Dome(Dome),
    Map(Box<Map>),
}

/// A scene: surfaces, lights, environment and camera. Made by [`SceneBuilder`](crate::SceneBuilder) or taken
/// from [`scenes`](crate::scenes). Immutable, and cheap to share behind an [`Arc`](std::sync::Arc).
#[derive(Clone, Debug)]
pub struct Scene {
    name: String,
    camera: Camera,
    pub(crate) optics: Optics,
    /// The origin of the scene's coordinates, in the caller's.
    origin: Vec3,
    pub(crate) sky: Option<Sky>,
    pub(crate) materials: Vec<CompiledMaterial>,
    pub(crate) geometry: Geometry,
    pub(crate) lights: Lights,
    pub(crate) emission_textures: Vec<Texture>,
    /// The index of the sun among the lights.
    pub(crate) sun: Option<usize>,
    pub(crate) bvh: Hierarchy,
    /// Whether any surface is partly transparent.
    pub(crate) has_opacity: bool,
    /// The least distance by which origins of scattered rays are moved off a surface.
    pub(crate) offset: f32,
    identity: SourceIdentity,
}

impl Scene {
    pub(crate) fn new(name: String, camera: Camera, parts: Parts) -> Result<Self, SceneError> {
        let Parts { surroundings, optics, materials, mut surfaces, geometry, mut lights, .. } = parts;
        let Parts { emission_textures, objects, mut instances, .. } = parts;
        check_memory((surfaces.len() + instances.len()).saturating_mul(BUILDING))?;
        let inside = |object: &Object| {
            let Range { start, end } = object.surfaces;
            Bvh::new(surfaces[start as usize..end as usize].to_vec())
        };
        let inside: Vec<Bvh> = objects.iter().map(inside).collect();
        keep_own(&mut surfaces, &objects);

        // Move far-away scenes to the origin
        let mut origin = Vec3::ZERO;
        let boxes = instances.iter().map(|instance| {
            let [middle, half] = instance.around(objects[instance.object()].bounds);
            [middle - half, middle + half]
        });
        let boxes = boxes.chain(accel::bounds(surfaces.iter().map(|surface| &surface.shape)));
        if let Some([low, high]) = boxes.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]) {
            let centre = 0.5 * (low + high);
            if centre.abs().max_element() > FAR * 0.5 * (high - low).length() {
                origin = centre;
                let by = -glam::Vec3::from(origin);
                surfaces.iter_mut().for_each(|surface| surface.shape = surface.shape.translated(by));
                instances.iter_mut().for_each(|instance| instance.translate(-origin));
                lights.iter_mut().for_each(|light| light.translate(-origin));
            }
        }
        let bvh = Hierarchy::new(Bvh::new(surfaces), inside, instances);

        let (sky, sun) = surround(surroundings, &mut lights);
        let has_opacity = geometry.groups.iter().any(|g| materials[g.material as usize].lets_pass());
        let bounds = bvh.bounds();
        let lights = Lights::new(lights, bounds, &means(&emission_textures));
        let offset = 1e-6 * 0.5 * (bounds[1] - bounds[0]).length();
        let identity = SourceIdentity::new(name.clone());
        Ok(Self {
            name,
            camera,
            optics,
            origin,
            sky,
            materials,
            geometry,
            lights,
            emission_textures,
            sun,
            bvh,
            has_opacity,
            offset,
            identity,
        })
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// What the scene was made from, for checkpoints: its name, unless a loader gave it more.
    pub fn identity(&self) -> &SourceIdentity {
        &self.identity
    }

    /// The same scene, with what its loader read.
    #[must_use]
    pub fn with_identity(mut self, identity: SourceIdentity) -> Self {
        self.identity = identity;
        self
    }

    pub fn camera(&self) -> Camera {
        self.camera
    }

    pub fn optics(&self) -> Optics {
        self.optics
    }

    /// The same scene seen by another camera.
    pub fn with_camera(mut self, camera: Camera) -> Result<Self, SceneError> {
        camera.check()?;
        self.camera = camera;
        Ok(self)
    }

    /// The same scene under a sky, which replaces what surrounds it.
    pub fn with_environment(mut self, environment: Environment) -> Result<Self, SceneError> {
        environment.check()?;
        let mut lights = std::mem::take(&mut self.lights.all);
        // What is far away comes last
        if self.sun.is_some() || self.map().is_some() {
            lights.pop();
        }
        (self.sky, self.sun) = surround(Some(Surroundings::Sky(environment)), &mut lights);
        self.lights = Lights::new(lights, self.bvh.bounds(), &means(&self.emission_textures));
        Ok(self)
    }

    /// The camera, prepared for an image of `width`×`height` pixels.
    pub(crate) fn lens(&self, width: usize, height: usize) -> Lens {
        self.camera.lens(&self.optics, width, height, self.origin)
    }

    /// Number of surfaces: triangles, parallelograms, spheres and ellipses. Those of an object count once, however
    /// many instances show it.
    pub fn surfaces(&self) -> usize {
        self.geometry.group_of.len()
    }

    pub fn instances(&self) -> usize {
        self.bvh.instances()
    }

    /// Number of lights. Each emitting triangle counts as one; so does the sun or the environment map.
    pub fn lights(&self) -> usize {
        self.lights.all.len()
    }

    /// Whether there is any light: an emitter, or a sky that is not black.
    pub fn is_lit(&self) -> bool {
        self.lights.all.iter().any(|l| l.radiance != Vec3::ZERO)
            || matches!(&self.sky, Some(Sky::Dome(dome)) if !dome.is_black())
    }

    /// Whether any surface is partly transparent or has no back
    /// ([`MaterialOptions::opacity`](crate::MaterialOptions::opacity) and `culled`), so that rays must test
    /// it. Other scenes are rendered by code without that test.
    pub fn has_opacity(&self) -> bool {
        self.has_opacity
    }

    /// Memory that the surfaces take, in bytes: the hierarchy, shading normals, texture coordinates,
    /// instances and lights, but not the pixels of textures.
    pub fn geometry_bytes(&self) -> usize {
        self.bvh.bytes() + self.geometry.bytes() + self.lights.bytes()
    }

    /// The environment map, if there is one.
    #[inline]
    pub(crate) fn map(&self) -> Option<&Map> {
        match &self.sky {
            Some(Sky::Map(map)) => Some(map),
            _ => None,
        }
    }
}

/// Keeps the surfaces that are of no object.
fn keep_own(surfaces: &mut Vec<Surface>, objects: &[Object]) {
    let mut next = objects.iter().map(|object| &object.surfaces).peekable();
    surfaces.retain(|surface| {
        while next.next_if(|object| object.end <= surface.prim).is_some() {}
        next.peek().is_none_or(|object| surface.prim < object.start)
    });
}

/// What surrounds a scene, and the index of the sun; its lights are added to `lights`, and come last.
fn surround(surroundings: Option<Surroundings>, lights: &mut Vec<Light>) -> (Option<Sky>, Option<usize>) {
    match surroundings {
        Some(Surroundings::Sky(environment)) => {
            let sun = sun_of(&environment).map(|light| {
                lights.push(light);
                lights.len() - 1
            });
            (Some(Sky::Dome(Dome::new(&environment))), sun)
        }
        Some(Surroundings::Map(map)) => {
            let map = Map::new(map);
            lights.push(Light::map(map.mean));
            (Some(Sky::Map(Box::new(map))), None)
        }
        None => (None, None),
    }
}

/// The mean colour of each texture.
fn means(textures: &[Texture]) -> Vec<Vec3> {
    textures.iter().map(Texture::mean).collect()
}

/// The sun of an environment, if it shines.
fn sun_of(environment: &Environment) -> Option<Light> {
    let sun = environment.sun.filter(|s| s.radiance != [0.0; 3])?;
    // In f64, since the squared length of a short vector vanishes in f32
    let direction = glam::Vec3::from(sun.direction).as_dvec3().normalize().as_vec3a();
    Some(Light::sun(direction, sun.angular_radius.to_radians(), sun.radiance.into()))
}

// Light that reaches a point of the scene: from its emitters, and from what surrounds it.

#[derive(Clone, Copy, Debug)]
pub(crate) struct Emitted<'a> {
    pub(crate) radiance: Vec3,
    pub(crate) light: &'a Light,
    /// Cosine between the ray and the light's normal.
    pub(crate) cos: f32,
}

impl Scene {
    /// Radiance that a camera sees from `dir` where nothing is in the way.
    pub(crate) fn backdrop(&self, dir: Vec3) -> Vec3 {
        if self.optics.hides_lights { Vec3::ZERO } else { self.background(dir, |_, _| 1.0) }
    }

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
