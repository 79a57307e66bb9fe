//! Builds scenes from meshes, spheres, materials, emitters, an environment and a camera.

use crate::accel::Shape;
use crate::camera::Camera;
use crate::environment::{Environment, check_radiance};
use crate::error::SceneError;
use crate::light::Light;
use crate::material::{Looks, Material};
use crate::math::Vec3;
use crate::scene::{Detail, NO, Prim, Scene};
use crate::texture::Texture;
use noisefloor::Rgb;

/// Largest number of surfaces (triangles, parallelograms, spheres) of a scene.
pub const MAX_SURFACES: usize = 1 << 26;
/// Largest absolute value of a coordinate: squares and their sums stay far from the limits of `f32`.
pub const MAX_COORDINATE: f32 = 1e6;
/// Triangles and parallelograms with less area than this (in squared scene units) are left out.
pub const MIN_AREA: f32 = 1e-18;

/// A material of a [`SceneBuilder`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MaterialId(u32);

/// Light that a surface gives off, the same in all directions, besides what it reflects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission {
    /// Linear radiance, 0…1e12.
    pub radiance: Rgb,
    /// Whether the back shines too. The front of a triangle is where its corners run counter-clockwise, that of a
    /// parallelogram where `e1`×`e2` points to, that of a sphere its outside.
    pub two_sided: bool,
}

impl Emission {
    /// Light from the front.
    pub fn front(radiance: Rgb) -> Self {
        Self { radiance, two_sided: false }
    }
}

/// Indexed triangles, borrowed from wherever they were read.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mesh<'a> {
    /// Corners, in scene units.
    pub positions: &'a [[f32; 3]],
    /// One shading normal a position, or none: flat faces. Need not have length 1; one of length 0 makes its triangles flat.
    pub normals: &'a [[f32; 3]],
    /// One pair of texture coordinates a position, or none: (0, 0), (1, 0), (0, 1) on each triangle.
    pub uvs: &'a [[f32; 2]],
    /// Three indices a triangle, counter-clockwise as seen from the front.
    pub indices: &'a [[u32; 3]],
}

/// Collects a scene, and checks each part as it comes.
///
/// ```
/// use noisefloor_ptwne::{Camera, Emission, Environment, Material, SceneBuilder};
/// let camera = Camera { eye: [0.0, 1.0, 4.0], target: [0.0, 1.0, 0.0], up: [0.0, 1.0, 0.0], vertical_fov: 40.0 };
/// let mut builder = SceneBuilder::new("ball", camera)?;
/// let grey = builder.material(Material::diffuse([0.5; 3]))?;
/// builder.parallelogram([-5.0, 0.0, 5.0], [10.0, 0.0, 0.0], [0.0, 0.0, -10.0], grey, None)?;
/// builder.sphere([0.0, 1.0, 0.0], 1.0, grey, None)?;
/// builder.sphere([2.0, 3.0, 2.0], 0.2, grey, Some(Emission::front([50.0; 3])))?;
/// builder.environment(Environment::constant([0.1, 0.2, 0.4]))?;
/// assert_eq!(builder.build()?.surfaces(), 3);
/// # Ok::<(), noisefloor_ptwne::SceneError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SceneBuilder {
    name: String,
    camera: Camera,
    environment: Option<Environment>,
    looks: Vec<Looks>,
    textures: Vec<Option<Texture>>,
    prims: Vec<Prim>,
    details: Vec<Detail>,
    lights: Vec<Light>,
}

impl SceneBuilder {
    /// An empty scene. The name goes into reports.
    ///
    /// # Errors
    /// [`SceneError`] if the camera looks nowhere or a number is out of range.
    pub fn new(name: impl Into<String>, camera: Camera) -> Result<Self, SceneError> {
        camera.check()?;
        Ok(Self {
            name: name.into(),
            camera,
            environment: None,
            looks: vec![],
            textures: vec![],
            prims: vec![],
            details: vec![],
            lights: vec![],
        })
    }

    /// Adds a material.
    ///
    /// # Errors
    /// [`SceneError`] if a reflectance, index of refraction or roughness is out of range, or an image has the wrong length.
    pub fn material(&mut self, material: Material) -> Result<MaterialId, SceneError> {
        material.check()?;
        let (looks, texture) = material.looks();
        self.looks.push(looks);
        self.textures.push(texture);
        Ok(MaterialId(self.looks.len() as u32 - 1))
    }

    /// Surrounds the scene with a sky. Without one, the surroundings are black.
    ///
    /// # Errors
    /// [`SceneError`] if a radiance is negative or not finite, or the sun's size is out of range.
    pub fn environment(&mut self, environment: Environment) -> Result<(), SceneError> {
        environment.check()?;
        self.environment = Some(environment);
        Ok(())
    }

    /// Adds the points `corner` + u·`e1` + v·`e2` for u, v in 0…1. Texture coordinates run in scene units along the edges, so
    /// that patterns have the same size on all parallelograms.
    ///
    /// # Errors
    /// [`SceneError`] if a number is not finite or too large, the material is not of this builder, or an emitter has no area.
    pub fn parallelogram(
        &mut self,
        corner: [f32; 3],
        e1: [f32; 3],
        e2: [f32; 3],
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), SceneError> {
        self.check_material(material, emission)?;
        let [corner, e1, e2] = [position(corner)?, position(e1)?, position(e2)?];
        let detail = if self.textures[material.0 as usize].is_some() {
            let uvs = [[0.0, 0.0], [e1.length(), 0.0], [0.0, e2.length()]];
            self.detail(Detail { normals: None, uvs })
        } else {
            NO
        };
        self.planar(corner, e1, e2, true, detail, material, emission)
    }

    /// Adds a sphere. Texture coordinates are azimuth and polar angle in 0…1; v = 1 is the top.
    ///
    /// # Errors
    /// [`SceneError`] if a number is not finite or too large, the radius is not positive or the material is not of this
    /// builder.
    pub fn sphere(
        &mut self,
        centre: [f32; 3],
        radius: f32,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), SceneError> {
        self.check_material(material, emission)?;
        let centre = position(centre)?;
        if !(1e-9..=MAX_COORDINATE).contains(&radius) {
            return Err(SceneError::Range {
                what: "the radius of a sphere",
                value: radius,
                range: "1e-9…1e6",
            });
        }
        self.push(Shape::Sphere { centre, radius }, Vec3::ZERO, NO, material, emission)
    }

    /// Adds the triangles of a mesh. Triangles without area are left out.
    ///
    /// # Errors
    /// [`SceneError`] if a number is not finite or too large, an index or a length does not fit, the material is not of this
    /// builder, or the mesh shines and a triangle has no area.
    pub fn mesh(
        &mut self,
        mesh: &Mesh<'_>,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), SceneError> {
        self.check_material(material, emission)?;
        let vertices = mesh.positions.len();
        for (what, found) in [("normals", mesh.normals.len()), ("texture coordinates", mesh.uvs.len())] {
            if found != 0 && found != vertices {
                return Err(SceneError::Lengths { what, positions: vertices, found });
            }
        }
        if !mesh.uvs.iter().flatten().all(|x| x.is_finite()) {
            return Err(SceneError::NotFinite { what: "a texture coordinate" });
        }
        for triangle in mesh.indices {
            if let Some(&index) = triangle.iter().find(|i| **i as usize >= vertices) {
                return Err(SceneError::Index { index, vertices });
            }
            let at = triangle.map(|i| i as usize);
            let [a, b, c] = [
                position(mesh.positions[at[0]])?,
                position(mesh.positions[at[1]])?,
                position(mesh.positions[at[2]])?,
            ];
            let mut normals = None;
            if !mesh.normals.is_empty() {
                let n = [
                    position(mesh.normals[at[0]])?,
                    position(mesh.normals[at[1]])?,
                    position(mesh.normals[at[2]])?,
                ];
                let n = n.map(Vec3::normalize_or_zero);
                normals = n.iter().all(|n| *n != Vec3::ZERO).then_some(n);
            }
            let detail = if normals.is_some() || !mesh.uvs.is_empty() {
                let uvs = if mesh.uvs.is_empty() {
                    [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
                } else {
                    at.map(|i| mesh.uvs[i])
                };
                self.detail(Detail { normals, uvs })
            } else {
                NO
            };
            self.planar(a, b - a, c - a, false, detail, material, emission)?;
        }
        Ok(())
    }

    /// Builds the scene.
    ///
    /// # Errors
    /// [`SceneError::TooLarge`] if it has more than [`MAX_SURFACES`].
    pub fn build(self) -> Result<Scene, SceneError> {
        if self.prims.len() > MAX_SURFACES {
            return Err(SceneError::TooLarge {
                what: "surfaces",
                found: self.prims.len(),
                limit: MAX_SURFACES,
            });
        }
        Ok(Scene::new(
            self.name,
            self.camera,
            self.environment,
            self.looks,
            self.textures,
            self.prims,
            self.details,
            self.lights,
        ))
    }

    fn check_material(&self, material: MaterialId, emission: Option<Emission>) -> Result<(), SceneError> {
        if material.0 as usize >= self.looks.len() {
            return Err(SceneError::Material(material.0));
        }
        emission.map_or(Ok(()), |e| check_radiance(e.radiance))
    }

    fn detail(&mut self, detail: Detail) -> u32 {
        self.details.push(detail);
        self.details.len() as u32 - 1
    }

    #[expect(clippy::too_many_arguments, reason = "one row of the table of surfaces")]
    fn planar(
        &mut self,
        corner: Vec3,
        e1: Vec3,
        e2: Vec3,
        whole: bool,
        detail: u32,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), SceneError> {
        // In f64: the squares of small edges vanish in f32
        let n = e1.as_dvec3().cross(e2.as_dvec3());
        if n.length() * 0.5 < f64::from(MIN_AREA) {
            return if emission.is_some() { Err(SceneError::EmptyEmitter) } else { Ok(()) };
        }
        let normal = n.normalize().as_vec3a();
        self.push(Shape::Planar { corner, e1, e2, whole }, normal, detail, material, emission)
    }

    fn push(
        &mut self,
        shape: Shape,
        normal: Vec3,
        detail: u32,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), SceneError> {
        let mut light = NO;
        if let Some(e) = emission.filter(|e| e.radiance != [0.0; 3]) {
            light = self.lights.len() as u32;
            self.lights.push(Light::surface(shape, Vec3::from_array(e.radiance), e.two_sided));
        }
        self.prims.push(Prim { shape, normal, material: material.0, light, detail });
        Ok(())
    }
}

fn position(p: [f32; 3]) -> Result<Vec3, SceneError> {
    for value in p {
        if !value.is_finite() {
            return Err(SceneError::NotFinite { what: "a position or normal" });
        }
        if value.abs() > MAX_COORDINATE {
            return Err(SceneError::Range { what: "a position or normal", value, range: "−1e6…1e6" });
        }
    }
    Ok(Vec3::from_array(p))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn builder() -> SceneBuilder {
        let camera =
            Camera { eye: [0.0, 0.0, 5.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], vertical_fov: 40.0 };
        SceneBuilder::new("test", camera).unwrap()
    }

    #[test]
    fn bad_input_is_a_typed_error() {
        let mut b = builder();
        assert!(matches!(b.material(Material::diffuse([1.2; 3])), Err(SceneError::Range { .. })));
        assert!(matches!(b.material(Material::diffuse([-0.1; 3])), Err(SceneError::Range { .. })));
        assert!(b.material(Material::Glass { ior: f32::NAN, tint: [1.0; 3] }).is_err());
        let noisy = Material::RoughConductor { reflectance: [0.5; 3].into(), roughness: 1.5 };
        assert!(b.material(noisy).is_err());
        let m = b.material(Material::diffuse([0.5; 3])).unwrap();
        let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        assert_eq!(b.parallelogram([0.0; 3], x, y, MaterialId(9), None), Err(SceneError::Material(9)));
        let nan = b.parallelogram([f32::NAN, 0.0, 0.0], x, y, m, None);
        assert!(matches!(nan, Err(SceneError::NotFinite { .. })));
        let light = Some(Emission::front([1.0; 3]));
        assert_eq!(b.parallelogram([0.0; 3], x, x, m, light), Err(SceneError::EmptyEmitter));
        assert!(b.parallelogram([0.0; 3], x, y, m, Some(Emission::front([-1.0; 3]))).is_err());
        assert!(b.sphere([0.0; 3], 0.0, m, None).is_err());
        assert!(b.sphere([1e30, 0.0, 0.0], 1.0, m, None).is_err());
        let positions = [[0.0; 3], x, y];
        let mesh = Mesh { positions: &positions, indices: &[[0, 1, 3]], ..Mesh::default() };
        assert_eq!(b.mesh(&mesh, m, None), Err(SceneError::Index { index: 3, vertices: 3 }));
        let mesh = Mesh { positions: &positions, uvs: &[[0.0; 2]], indices: &[[0, 1, 2]], ..Mesh::default() };
        assert!(matches!(b.mesh(&mesh, m, None), Err(SceneError::Lengths { .. })));
        assert_eq!(b.build().unwrap().surfaces(), 0);
    }

    #[test]
    fn triangles_without_area_are_left_out() {
        let mut b = builder();
        let m = b.material(Material::diffuse([0.5; 3])).unwrap();
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh =
            Mesh { positions: &positions, indices: &[[0, 1, 2], [0, 0, 3], [0, 1, 3]], ..Mesh::default() };
        b.mesh(&mesh, m, None).unwrap();
        assert_eq!(b.mesh(&mesh, m, Some(Emission::front([1.0; 3]))), Err(SceneError::EmptyEmitter));
        assert_eq!(b.build().unwrap().surfaces(), 1);
    }
}
