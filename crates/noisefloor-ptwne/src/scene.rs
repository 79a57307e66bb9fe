//! A scene, ready to be rendered.

use crate::accel::{Accel, Hit, Shape};
use crate::camera::Camera;
use crate::environment::{Dome, Environment};
use crate::light::{Light, Lights};
use crate::material::{Kind, Looks};
use crate::math::{Ray, Vec3};
use crate::texture::Texture;

/// "None" among indices.
pub(crate) const NO: u32 = u32::MAX;

/// A surface: its shape, and where its looks are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prim {
    pub(crate) shape: Shape,
    /// Of a planar surface; its front.
    pub(crate) normal: Vec3,
    pub(crate) material: u32,
    pub(crate) light: u32,
    pub(crate) detail: u32,
}

/// What smooth or textured surfaces have besides: values at `corner`, `corner + e1` and `corner + e2`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Detail {
    pub(crate) normals: Option<[Vec3; 3]>,
    pub(crate) uvs: [[f32; 2]; 3],
}

/// What a scene needs of the integrator; it is compiled once for each combination, so that no path meets code that its scene
/// cannot need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Needs {
    /// Spheres, shading normals or textures.
    pub(crate) surfaces: bool,
    /// Anything but diffuse materials.
    pub(crate) bsdfs: bool,
    /// An environment.
    pub(crate) sky: bool,
}

/// A scene: surfaces, lights, environment and camera. Made by [`SceneBuilder`](crate::SceneBuilder) or taken from
/// [`scenes`](crate::scenes); immutable, and cheap to share behind an [`Arc`](std::sync::Arc).
#[derive(Clone, Debug)]
pub struct Scene {
    pub(crate) name: String,
    pub(crate) camera: Camera,
    pub(crate) dome: Option<Dome>,
    pub(crate) looks: Vec<Looks>,
    pub(crate) textures: Vec<Option<Texture>>,
    pub(crate) prims: Vec<Prim>,
    pub(crate) details: Vec<Detail>,
    pub(crate) lights: Lights,
    /// The sun among the lights.
    pub(crate) sun: Option<usize>,
    pub(crate) accel: Accel,
    pub(crate) needs: Needs,
    /// How far origins of scattered rays are moved off a surface, at least.
    pub(crate) offset: f32,
}

/// Where a ray met the scene, seen from where it came from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub(crate) position: Vec3,
    /// The geometric normal, on the side of the ray's origin.
    pub(crate) flat: Vec3,
    /// The shading normal, on that side too.
    pub(crate) normal: Vec3,
    /// Whether the ray met the front.
    pub(crate) front: bool,
    pub(crate) looks: Looks,
}

impl Scene {
    #[expect(clippy::too_many_arguments, reason = "the builder's fields")]
    pub(crate) fn new(
        name: String,
        camera: Camera,
        environment: Option<Environment>,
        looks: Vec<Looks>,
        textures: Vec<Option<Texture>>,
        prims: Vec<Prim>,
        details: Vec<Detail>,
        mut lights: Vec<Light>,
    ) -> Self {
        let shapes: Vec<Shape> = prims.iter().map(|p| p.shape).collect();
        let accel = Accel::new(&shapes);
        let extent = accel.extent();
        // The sun comes last among the lights
        let mut sun = None;
        if let Some(s) = environment.and_then(|e| e.sun).filter(|s| s.radiance != [0.0; 3]) {
            // In f64: the length of a tiny vector would vanish
            let direction = Vec3::from_array(s.direction).as_dvec3().normalize().as_vec3a();
            sun = Some(lights.len());
            lights.push(Light::sun(direction, s.angular_radius.to_radians(), Vec3::from_array(s.radiance)));
        }
        let round = |p: &Prim| matches!(p.shape, Shape::Sphere { .. });
        let needs = Needs {
            surfaces: !details.is_empty() || prims.iter().any(round) || textures.iter().any(Option::is_some),
            bsdfs: looks.iter().any(|l| l.kind != Kind::Diffuse),
            sky: environment.is_some(),
        };
        Self {
            name,
            camera,
            dome: environment.as_ref().map(Dome::new),
            looks,
            textures,
            prims,
            details,
            lights: Lights::new(lights, extent),
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

    /// Number of surfaces: triangles, parallelograms and spheres.
    pub fn surfaces(&self) -> usize {
        self.prims.len()
    }

    /// Number of lights, each shining triangle counted as one, and the sun.
    pub fn lights(&self) -> usize {
        self.lights.all.len()
    }

    /// What the ray met. `SURFACES` says whether the scene has anything but flat, untextured surfaces.
    #[inline]
    pub(crate) fn surface<const SURFACES: bool>(&self, ray: &Ray, hit: &Hit, prim: &Prim) -> Surface {
        let mut looks = self.looks[prim.material as usize];
        let [u, v] = hit.uv;
        let (position, mut flat) = match prim.shape {
            Shape::Planar { corner, e1, e2, .. } => (corner + e1 * u + e2 * v, prim.normal),
            Shape::Sphere { centre, radius } => {
                let n = (ray.origin + ray.dir * hit.t - centre).normalize();
                (centre + n * radius, n)
            }
        };
        let mut normal = flat;
        if SURFACES {
            let mut uv = hit.uv;
            if let Some(detail) = self.details.get(prim.detail as usize) {
                let [a, b, c] = detail.uvs;
                uv = std::array::from_fn(|i| a[i] + (b[i] - a[i]) * u + (c[i] - a[i]) * v);
                if let Some([a, b, c]) = detail.normals {
                    normal = (a * (1.0 - u - v) + b * u + c * v).try_normalize().unwrap_or(flat);
                }
            } else if looks.textured
                && let Shape::Sphere { .. } = prim.shape
            {
                use std::f32::consts::{FRAC_1_PI, PI};
                let polar = flat.y.clamp(-1.0, 1.0).acos() * FRAC_1_PI;
                uv = [(flat.z.atan2(flat.x) + PI) * 0.5 * FRAC_1_PI, 1.0 - polar];
            }
            if looks.textured
                && let Some(texture) = &self.textures[prim.material as usize]
            {
                looks.colour = texture.eval(uv[0], uv[1]);
            }
        }
        // Turn both normals to where the ray came from
        let front = ray.dir.dot(flat) < 0.0;
        if !front {
            (flat, normal) = (-flat, -normal);
        }
        if SURFACES && normal.dot(ray.dir) >= 0.0 {
            normal = flat;
        }
        Surface { position, flat, normal, front, looks }
    }

    /// The origin of a ray that leaves `surface` towards the side that `dir` points to.
    #[inline]
    pub(crate) fn leave(&self, surface: &Surface, dir: Vec3) -> Vec3 {
        // A few hundred roundings of the largest coordinate
        let distance = (surface.position.abs().max_element() * 1e-5).max(self.offset);
        let side = if dir.dot(surface.flat) < 0.0 { -distance } else { distance };
        surface.position + surface.flat * side
    }
}
