//! A scene, ready to be rendered.

use crate::accel::{self, Accel, Hit, Local, Shape, Stack};
use crate::bsdf::Glossy;
use crate::camera::{Camera, Lens};
use crate::environment::{Dome, Environment, EnvironmentMap, Map};
use crate::light::{Aim, Light, Lights, Place};
use crate::material::{Kind, Looks, MIN_ROUGHNESS};
use crate::math::{Ray, Vec3};
use crate::rng;
use crate::texture::Texture;

/// A scene whose middle is this many times as far from the origin as it is large is moved there: of each coordinate f32 keeps
/// 24 bits, and those that only say where the scene is are lost to it.
const FAR: f32 = 16.0;

/// "None" among indices.
pub(crate) const NO: u32 = u32::MAX;

/// Surfaces that came together: they share a material, and are numbered from `first` on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Group {
    pub(crate) first: u32,
    pub(crate) material: u32,
    /// The light of the first surface; the others follow. [`NO`] if they do not shine.
    pub(crate) light: u32,
    /// Where the corners of the first surface are; [`NO`] if the group is flat and has no texture coordinates.
    pub(crate) corners: u32,
    /// What the corners' indices count from in [`Details::normals`] and [`Details::uvs`]; [`NO`] if there are none.
    pub(crate) normals: u32,
    pub(crate) uvs: u32,
}

/// What smooth or textured surfaces have besides their shape, at their corners.
#[derive(Clone, Debug, Default)]
pub(crate) struct Details {
    pub(crate) corners: Vec<[u32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
    pub(crate) uvs: Vec<[f32; 2]>,
}

/// What a scene has that the integrator needs code for. It is compiled once for each combination, so that no path meets code
/// that its scene cannot need.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// Textures or smooth shading normals.
    pub textures: bool,
    /// Microfacets or coats.
    pub glossy: bool,
    /// Mirrors or glass.
    pub specular: bool,
    /// An environment.
    pub sky: bool,
    /// Surfaces with holes.
    pub holes: bool,
}

impl Needs {
    /// All there is.
    pub const ALL: Self = Self { textures: true, glossy: true, specular: true, sky: true, holes: true };

    /// The needs of both.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self {
            textures: self.textures | other.textures,
            glossy: self.glossy | other.glossy,
            specular: self.specular | other.specular,
            sky: self.sky | other.sky,
            holes: self.holes | other.holes,
        }
    }
}

/// How a ray decides whether it meets a surface with holes.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Holes {
    /// By chance, from a seed of its own.
    Drawn(u64),
    /// As ray `index` of many with one seed that share the work: of each 2ᵏ that follow each other, each surface lets pass as
    /// many as it should, to the nearest, and other ones than other surfaces do.
    Shared { index: u32, seed: u64 },
}

/// What surrounds a scene.
#[derive(Clone, Debug)]
pub(crate) enum Sky {
    Dome(Dome),
    Map(Box<Map>),
}

/// What surrounds a scene, as a builder has it.
#[derive(Clone, Debug)]
pub(crate) enum Surroundings {
    Dome(Environment),
    Map(EnvironmentMap),
}

/// What a builder collects.
#[derive(Clone, Debug, Default)]
pub(crate) struct Parts {
    pub(crate) surroundings: Option<Surroundings>,
    pub(crate) looks: Vec<Looks>,
    pub(crate) shapes: Vec<Shape>,
    pub(crate) group_of: Vec<u32>,
    pub(crate) groups: Vec<Group>,
    pub(crate) details: Details,
    pub(crate) lights: Vec<Light>,
    /// Factors on emitted radiance.
    pub(crate) glows: Vec<Texture>,
}

/// A scene: surfaces, lights, environment and camera. Made by [`SceneBuilder`](crate::SceneBuilder) or taken from
/// [`scenes`](crate::scenes); immutable, and cheap to share behind an [`Arc`](std::sync::Arc).
#[derive(Clone, Debug)]
pub struct Scene {
    pub(crate) name: String,
    camera: Camera,
    /// Where the scene's coordinates begin, in the caller's.
    origin: Vec3,
    pub(crate) sky: Option<Sky>,
    pub(crate) looks: Vec<Looks>,
    pub(crate) group_of: Vec<u32>,
    pub(crate) groups: Vec<Group>,
    pub(crate) details: Details,
    pub(crate) lights: Lights,
    pub(crate) glows: Vec<Texture>,
    /// The sun among the lights.
    sun: Option<usize>,
    pub(crate) accel: Accel,
    pub(crate) needs: Needs,
    /// How far origins of scattered rays are moved off a surface, at least.
    pub(crate) offset: f32,
}

/// Where a ray met the scene, seen from where it came from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface<'a> {
    pub(crate) position: Vec3,
    /// The geometric normal, on the side of the ray's origin.
    pub(crate) flat: Vec3,
    /// The shading normal, on that side too.
    pub(crate) normal: Vec3,
    /// Whether the ray met the front.
    pub(crate) front: bool,
    pub(crate) uv: [f32; 2],
    pub(crate) looks: &'a Looks,
    /// The light that it is; [`NO`] if it does not shine.
    pub(crate) light: u32,
}

impl Scene {
    pub(crate) fn new(name: String, camera: Camera, parts: Parts) -> Self {
        let Parts { surroundings, looks, mut shapes, group_of, groups, details, mut lights, glows } = parts;
        let mut origin = Vec3::ZERO;
        if let Some([low, high]) = accel::bounds(&shapes) {
            let middle = 0.5 * (low + high);
            if middle.abs().max_element() > FAR * 0.5 * (high - low).length() {
                origin = middle;
                shapes.iter_mut().for_each(|shape| *shape = shape.moved(-glam::Vec3::from(origin)));
                lights.iter_mut().for_each(|light| light.shift(-origin));
            }
        }
        let accel = Accel::new(&shapes);
        drop(shapes);
        let bounds = accel.bounds();
        // What is far away comes last among the lights
        let (mut sky, mut sun) = (None, None);
        match surroundings {
            Some(Surroundings::Dome(environment)) => {
                sky = Some(Sky::Dome(Dome::new(&environment)));
                if let Some(s) = environment.sun.filter(|s| s.radiance != [0.0; 3]) {
                    // In f64: the length of a tiny vector would vanish
                    let direction = glam::Vec3::from(s.direction).as_dvec3().normalize().as_vec3a();
                    sun = Some(lights.len());
                    lights.push(Light::sun(direction, s.angular_radius.to_radians(), s.radiance.into()));
                }
            }
            Some(Surroundings::Map(map)) => {
                let map = Map::new(map);
                lights.push(Light::map(map.mean));
                sky = Some(Sky::Map(Box::new(map)));
            }
            None => {}
        }
        let used = |test: fn(&Looks) -> bool| groups.iter().any(|g| test(&looks[g.material as usize]));
        let needs = Needs {
            textures: used(Looks::is_textured) || !glows.is_empty() || groups.iter().any(|g| g.normals != NO),
            glossy: used(Looks::is_glossy),
            specular: used(Looks::is_specular),
            sky: sky.is_some(),
            holes: used(|l| l.opacity.is_some()),
        };
        let means: Vec<Vec3> = glows.iter().map(Texture::mean).collect();
        let extent = 0.5 * (bounds[1] - bounds[0]).length();
        Self {
            name,
            camera,
            origin,
            sky,
            looks,
            group_of,
            groups,
            details,
            lights: Lights::new(lights, bounds, &means),
            glows,
            sun,
            accel,
            needs,
            offset: 1e-6 * extent,
        }
    }

    /// The scene's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The camera.
    pub fn camera(&self) -> Camera {
        self.camera
    }

    /// The same scene seen by another camera.
    ///
    /// # Errors
    /// [`SceneError`](crate::SceneError) if the camera looks nowhere or a number is out of range.
    pub fn with_camera(mut self, camera: Camera) -> Result<Self, crate::SceneError> {
        camera.check()?;
        self.camera = camera;
        Ok(self)
    }

    /// The camera at work on an image of `width`×`height` pixels.
    pub(crate) fn lens(&self, width: usize, height: usize) -> Lens {
        self.camera.lens(width, height, self.origin)
    }

    /// Number of surfaces: triangles, parallelograms, spheres and ellipses.
    pub fn surfaces(&self) -> usize {
        self.group_of.len()
    }

    /// Number of lights, each shining triangle counted as one, and the sun or the environment map.
    pub fn lights(&self) -> usize {
        self.lights.all.len()
    }

    /// Number of lights that cannot matter, and are not sampled: black ones and those that face away from everything.
    pub fn idle_lights(&self) -> usize {
        self.lights.all.iter().filter(|l| l.chance <= 0.0).count()
    }

    /// What the scene has that the integrator needs code for.
    pub fn needs(&self) -> Needs {
        self.needs
    }

    /// Bytes that the surfaces take: the hierarchy, shading normals and texture coordinates, but no pixels of textures.
    pub fn geometry_bytes(&self) -> usize {
        let Details { corners, normals, uvs } = &self.details;
        self.accel.bytes()
            + size_of_val(self.group_of.as_slice())
            + size_of_val(self.groups.as_slice())
            + size_of_val(corners.as_slice())
            + size_of_val(normals.as_slice())
            + size_of_val(uvs.as_slice())
            + size_of_val(self.lights.all.as_slice())
    }

    /// The environment map, if there is one.
    #[inline]
    pub(crate) fn map(&self) -> Option<&Map> {
        match &self.sky {
            Some(Sky::Map(map)) => Some(map),
            _ => None,
        }
    }

    /// Radiance from `dir` of what is infinitely far away; `weigh` says how much counts of what next events could have aimed at
    /// with some density, once they had chosen this light with some chance.
    #[inline]
    pub(crate) fn beyond(&self, dir: Vec3, weigh: impl FnOnce(f32, f32) -> f32) -> Vec3 {
        match &self.sky {
            None => Vec3::ZERO,
            Some(Sky::Map(map)) => {
                // The map is the last light
                map.radiance(dir) * weigh(map.pdf(dir), self.lights.all[self.lights.all.len() - 1].chance)
            }
            Some(Sky::Dome(dome)) => {
                let mut sum = dome.radiance(dir);
                if let Some(sun) = self.sun.map(|i| &self.lights.all[i]).filter(|sun| sun.covers(dir)) {
                    sum += sun.radiance * weigh(sun.pdf(Vec3::ZERO, 0.0, 1.0), sun.chance);
                }
                sum
            }
        }
    }

    /// The nearest surface along the ray.
    #[inline]
    pub(crate) fn closest<const HOLES: bool>(&self, ray: &Ray, stack: &mut Stack, holes: Holes) -> Hit {
        if HOLES {
            self.accel.closest(ray, stack, |prim, uv| self.is_solid(prim, uv, holes))
        } else {
            self.accel.closest(ray, stack, |_, _| true)
        }
    }

    /// Whether any surface lies on the ray before `t_max`.
    #[inline]
    pub(crate) fn blocked<const HOLES: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
        stack: &mut Stack,
        holes: Holes,
    ) -> bool {
        if HOLES {
            self.accel.blocked::<true>(ray, t_max, stack, |prim, uv| self.is_solid(prim, uv, holes))
        } else {
            self.accel.blocked::<false>(ray, t_max, stack, |_, _| true)
        }
    }

    fn is_solid(&self, prim: u32, uv: [f32; 2], holes: Holes) -> bool {
        let group = &self.groups[self.group_of[prim as usize] as usize];
        match &self.looks[group.material as usize].opacity {
            None => true,
            Some(opacity) => {
                let [u, v] = self.texture_coordinates(group, prim, uv);
                let c = opacity.eval(u, v);
                let number = match holes {
                    Holes::Drawn(seed) => rng::hash(seed, prim),
                    Holes::Shared { index, seed } => {
                        sobol_burley::sample(index, 0, rng::mix(seed ^ u64::from(prim)) as u32)
                    }
                };
                number < (c.x + c.y + c.z) * (1.0 / 3.0)
            }
        }
    }

    /// Texture coordinates of a planar surface at `uv` along its edges.
    #[inline]
    fn texture_coordinates(&self, group: &Group, prim: u32, [u, v]: [f32; 2]) -> [f32; 2] {
        if group.uvs == NO {
            return [u, v];
        }
        let corners = self.details.corners[(group.corners + prim - group.first) as usize];
        let [a, b, c] = corners.map(|i| self.details.uvs[(group.uvs + i) as usize]);
        std::array::from_fn(|i| a[i] + (b[i] - a[i]) * u + (c[i] - a[i]) * v)
    }

    /// The factor on the radiance that `light` gives off at `uv` along its edges.
    #[inline]
    pub(crate) fn glow(&self, light: &Light, uv: [f32; 2]) -> Vec3 {
        match self.glows.get(light.texture as usize) {
            None => Vec3::ONE,
            Some(texture) => {
                let group = &self.groups[self.group_of[light.prim as usize] as usize];
                let [u, v] = self.texture_coordinates(group, light.prim, uv);
                texture.eval(u, v)
            }
        }
    }

    /// What `surface`, a light, gives off towards where the ray along `dir` came from, the light and the cosine there; none
    /// if it is its dark side.
    #[inline]
    pub(crate) fn emitted<const TEXTURES: bool>(
        &self,
        surface: &Surface<'_>,
        hit: &Hit,
        dir: Vec3,
    ) -> Option<(Vec3, &Light, f32)> {
        if surface.light == NO {
            return None;
        }
        let light = &self.lights.all[surface.light as usize];
        let cos = -dir.dot(surface.flat) * if surface.front { 1.0 } else { -1.0 };
        let factor = if TEXTURES { self.glow(light, hit.uv) } else { Vec3::ONE };
        light.shines(cos).then_some((light.radiance * factor, light, cos))
    }

    /// A point on `light` as seen from `from`; see [`Light::aim`].
    #[inline]
    pub(crate) fn aim<const TEXTURES: bool>(&self, light: &Light, from: Vec3, u: [f32; 3]) -> Option<Aim> {
        let mut aim = light.aim(from, u, self.map())?;
        if TEXTURES && light.texture != NO {
            aim.value *= self.glow(light, aim.uv);
        }
        Some(aim)
    }

    /// What [`Aim::value`] still lacks.
    #[inline]
    pub(crate) fn revealed(&self, light: &Light, dir: Vec3) -> Vec3 {
        match (&light.place, self.map()) {
            (Place::Map, Some(map)) => map.radiance(dir),
            _ => Vec3::ONE,
        }
    }

    /// What the ray met. `TEXTURES` says whether the scene has any, or smooth normals.
    #[inline]
    pub(crate) fn surface<const TEXTURES: bool>(&self, ray: &Ray, hit: &Hit) -> Surface<'_> {
        let place = self.accel.place(hit);
        let group = &self.groups[self.group_of[place.prim as usize] as usize];
        let looks = &self.looks[group.material as usize];
        let along = ray.origin + ray.dir * hit.t;
        // Back onto the surface: the error along it does not matter, that across would
        let (position, mut flat) = match place.local {
            Local::Plane { normal } => (along - normal * normal.dot(along - place.corner), normal),
            Local::Sphere { radius } => {
                let n = (along - place.corner).normalize();
                (place.corner + n * radius, n)
            }
        };
        let (mut normal, mut uv) = (flat, hit.uv);
        if TEXTURES {
            if let Local::Sphere { .. } = place.local {
                use std::f32::consts::{FRAC_1_PI, PI};
                let polar = flat.y.clamp(-1.0, 1.0).acos() * FRAC_1_PI;
                uv = [(flat.z.atan2(flat.x) + PI) * 0.5 * FRAC_1_PI, 1.0 - polar];
            } else {
                uv = self.texture_coordinates(group, place.prim, hit.uv);
            }
            if group.normals != NO {
                let corners = self.details.corners[(group.corners + place.prim - group.first) as usize];
                let [a, b, c] =
                    corners.map(|i| Vec3::from_array(self.details.normals[(group.normals + i) as usize]));
                let [u, v] = hit.uv;
                normal = (a * (1.0 - u - v) + b * u + c * v).try_normalize().unwrap_or(flat);
            }
        }
        // Turn both normals to where the ray came from
        let front = ray.dir.dot(flat) < 0.0;
        if !front {
            (flat, normal) = (-flat, -normal);
        }
        if TEXTURES && normal.dot(ray.dir) >= 0.0 {
            normal = flat;
        }
        let light = if group.light == NO { NO } else { group.light + place.prim - group.first };
        Surface { position, flat, normal, front, uv, looks, light }
    }

    /// The origin of a ray that leaves `surface` towards the side that `dir` points to.
    #[inline]
    pub(crate) fn leave(&self, surface: &Surface<'_>, dir: Vec3) -> Vec3 {
        // A few hundred roundings of the largest coordinate
        let distance = (surface.position.abs().max_element() * 1e-5).max(self.offset);
        let side = if dir.dot(surface.flat) < 0.0 { -distance } else { distance };
        surface.position + surface.flat * side
    }
}

impl<'a> Surface<'a> {
    /// Its microfacets and coat, seen at a cosine with the shading normal; `None` if it has none.
    #[inline]
    pub(crate) fn glossy<const TEXTURES: bool>(&self, cos: f32) -> Option<Glossy<'a>> {
        match &self.looks.kind {
            Kind::Metal { fresnel, colour, alpha } => {
                Some(Glossy::metal(fresnel, colour.at::<TEXTURES>(self.uv), *alpha))
            }
            Kind::Plastic { diffuse, specular, alpha, nonlinear, coat } => {
                let diffuse = diffuse.at::<TEXTURES>(self.uv);
                Some(Glossy::plastic(coat, diffuse, *specular, *alpha, *nonlinear, cos))
            }
            Kind::Blend { base, metallic_roughness, coat } => {
                let values = metallic_roughness.at::<TEXTURES>(self.uv);
                let alpha = (values.y * values.y).max(MIN_ROUGHNESS);
                Some(Glossy::blend(coat, base.at::<TEXTURES>(self.uv), alpha, values.z, cos))
            }
            _ => None,
        }
    }
}
