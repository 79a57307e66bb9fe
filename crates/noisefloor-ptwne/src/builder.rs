//! Builds scenes from meshes, spheres, materials, emitters, an environment and a camera.

use crate::accel::Shape;
use crate::bsdf::Coat;
use crate::camera::Camera;
use crate::environment::{Environment, EnvironmentMap, check_radiance};
use crate::error::SceneError;
use crate::light::{Light, Punctual};
use crate::material::{Cover, Looks, Material};
use crate::scene::{Group, NO, Parts, Scene, Surroundings};
use crate::texture::Texture;
use glam::Vec3;
use noisefloor::Rgb;
use std::sync::Arc;

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
#[derive(Clone, Debug, PartialEq)]
pub struct Emission {
    /// Linear radiance, 0…1e12.
    pub radiance: Rgb,
    /// Multiplies the radiance, by the texture coordinates of the surface; spheres have none for this.
    pub texture: Option<Texture>,
    /// Whether the back shines too. The front of a triangle is where its corners run counter-clockwise, that of a
    /// parallelogram or ellipse where `e1`×`e2` points to, that of a sphere its outside.
    pub two_sided: bool,
}

impl Emission {
    /// Light from the front.
    pub fn front(radiance: Rgb) -> Self {
        Self { radiance, texture: None, two_sided: false }
    }

    /// Light from both sides.
    pub fn two_sided(radiance: Rgb) -> Self {
        Self { two_sided: true, ..Self::front(radiance) }
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
    parts: Parts,
    coats: Vec<Arc<Coat>>,
}

impl SceneBuilder {
    /// An empty scene. The name goes into reports.
    ///
    /// # Errors
    /// [`SceneError`] if the camera looks nowhere or a number is out of range.
    pub fn new(name: impl Into<String>, camera: Camera) -> Result<Self, SceneError> {
        camera.check()?;
        Ok(Self { name: name.into(), camera, parts: Parts::default(), coats: vec![] })
    }

    /// Adds a material that covers its surfaces wholly and on both sides.
    ///
    /// # Errors
    /// As [`SceneBuilder::material_with`].
    pub fn material(&mut self, material: Material) -> Result<MaterialId, SceneError> {
        self.material_with(material, Cover::default())
    }

    /// Adds a material, with holes or for one side.
    ///
    /// # Errors
    /// [`SceneError`] if a reflectance, index of refraction or roughness is out of range, or an image has the wrong length.
    pub fn material_with(&mut self, material: Material, cover: Cover) -> Result<MaterialId, SceneError> {
        self.parts.looks.push(Looks::new(material, cover, &mut self.coats)?);
        Ok(MaterialId(self.parts.looks.len() as u32 - 1))
    }

    /// Surrounds the scene with a sky, instead of what surrounded it before. Without one, the surroundings are black.
    ///
    /// # Errors
    /// [`SceneError`] if a radiance is negative or not finite, or the sun's size is out of range.
    pub fn environment(&mut self, environment: Environment) -> Result<(), SceneError> {
        environment.check()?;
        self.parts.surroundings = Some(Surroundings::Dome(environment));
        Ok(())
    }

    /// Surrounds the scene with an image, instead of what surrounded it before.
    ///
    /// # Errors
    /// [`SceneError`] if the image has the wrong length, a radiance is negative or not finite, or the rotation is none.
    pub fn environment_map(&mut self, map: EnvironmentMap) -> Result<(), SceneError> {
        map.check()?;
        self.parts.surroundings = Some(Surroundings::Map(map));
        Ok(())
    }

    /// Adds a light without size.
    ///
    /// # Errors
    /// [`SceneError`] if a number is not finite or out of range, or a direction is zero.
    pub fn punctual(&mut self, light: Punctual) -> Result<(), SceneError> {
        self.parts.lights.push(Light::punctual(light)?);
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
        let [corner, e1, e2] = [position(corner)?, position(e1)?, position(e2)?];
        let uvs = [[0.0, 0.0], [e1.length(), 0.0], [0.0, e2.length()]];
        self.alone(Shape::Planar { corner, e1, e2, whole: true }, Some(uvs), material, emission)
    }

    /// Adds an ellipse: `centre` + u·`e1` + v·`e2` for u² + v² ≤ 1. Texture coordinates are (u + 1, v + 1)/2.
    ///
    /// # Errors
    /// As [`SceneBuilder::parallelogram`].
    pub fn disk(
        &mut self,
        centre: [f32; 3],
        e1: [f32; 3],
        e2: [f32; 3],
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), SceneError> {
        let [centre, e1, e2] = [position(centre)?, position(e1)?, position(e2)?];
        let uvs = [[0.5, 0.5], [1.0, 0.5], [0.5, 1.0]];
        self.alone(Shape::Disk { centre, e1, e2 }, Some(uvs), material, emission)
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
        let centre = position(centre)?;
        if !(1e-9..=MAX_COORDINATE).contains(&radius) {
            return Err(SceneError::Range {
                what: "the radius of a sphere",
                value: radius,
                range: "1e-9…1e6",
            });
        }
        self.alone(Shape::Sphere { centre, radius }, None, material, emission)
    }

    /// Adds the triangles of a mesh, but for those without area, and returns how many those are.
    ///
    /// # Errors
    /// [`SceneError`] if a number is not finite or too large, an index or a length does not fit, the material is not of this
    /// builder, or the mesh shines and has no area at all.
    pub fn mesh(
        &mut self,
        mesh: &Mesh<'_>,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<usize, SceneError> {
        let vertices = mesh.positions.len();
        for (what, found) in [("normals", mesh.normals.len()), ("texture coordinates", mesh.uvs.len())] {
            if found != 0 && found != vertices {
                return Err(SceneError::Lengths { what, positions: vertices, found });
            }
        }
        if !mesh.uvs.iter().flatten().all(|x| x.is_finite()) {
            return Err(SceneError::NotFinite { what: "a texture coordinate" });
        }
        for p in mesh.positions.iter().chain(mesh.normals) {
            position(*p)?;
        }
        if let Some(&index) = mesh.indices.iter().flatten().find(|i| **i as usize >= vertices) {
            return Err(SceneError::Index { index, vertices });
        }
        let detailed = !mesh.normals.is_empty() || !mesh.uvs.is_empty();
        let (mut group, shine) = self.group(material, emission.as_ref())?;
        if detailed {
            let details = &mut self.parts.details;
            group.corners = index(details.corners.len())?;
            if !mesh.normals.is_empty() {
                group.normals = index(details.normals.len())?;
                let unit = |n: &[f32; 3]| Vec3::from(*n).as_dvec3().normalize_or_zero().as_vec3().to_array();
                details.normals.extend(mesh.normals.iter().map(unit));
            }
            if !mesh.uvs.is_empty() {
                group.uvs = index(details.uvs.len())?;
                details.uvs.extend(mesh.uvs);
            }
        }
        let mut left_out = 0;
        for triangle in mesh.indices {
            let [a, b, c] = triangle.map(|i| Vec3::from(mesh.positions[i as usize]));
            let shape = Shape::Planar { corner: a, e1: b - a, e2: c - a, whole: false };
            if self.push(shape, shine)? {
                if detailed {
                    self.parts.details.corners.push(*triangle);
                }
            } else {
                left_out += 1;
            }
        }
        if left_out == mesh.indices.len() && emission.is_some() {
            return Err(SceneError::EmptyEmitter);
        }
        self.close(group);
        Ok(left_out)
    }

    /// Builds the scene.
    ///
    /// # Errors
    /// [`SceneError::TooLarge`] if it has more than [`MAX_SURFACES`].
    pub fn build(self) -> Result<Scene, SceneError> {
        Ok(Scene::new(self.name, self.camera, self.parts))
    }

    /// A group for what comes next, and how it shines.
    fn group(
        &mut self,
        material: MaterialId,
        emission: Option<&Emission>,
    ) -> Result<(Group, Option<Shine>), SceneError> {
        if material.0 as usize >= self.parts.looks.len() {
            return Err(SceneError::Material(material.0));
        }
        if let Some(emission) = emission {
            check_radiance(emission.radiance)?;
            if let Some(texture) = &emission.texture {
                texture.check()?;
            }
        }
        let shine = emission.filter(|e| e.radiance != [0.0; 3]).map(|e| Shine {
            radiance: e.radiance,
            two_sided: e.two_sided,
            texture: e.texture.as_ref().map_or(NO, |texture| {
                self.parts.glows.push(texture.clone());
                self.parts.glows.len() as u32 - 1
            }),
        });
        let light = if shine.is_some() { index(self.parts.lights.len())? } else { NO };
        let first = index(self.parts.shapes.len())?;
        Ok((Group { first, material: material.0, light, corners: NO, normals: NO, uvs: NO }, shine))
    }

    /// Adds the group of the surfaces that came since.
    fn close(&mut self, group: Group) {
        if self.parts.shapes.len() > group.first as usize {
            let number = self.parts.groups.len() as u32;
            self.parts.groups.push(group);
            self.parts.group_of.resize(self.parts.shapes.len(), number);
        }
    }

    /// Adds a surface that is a group of its own, with texture coordinates at the ends of its edges.
    fn alone(
        &mut self,
        shape: Shape,
        uvs: Option<[[f32; 2]; 3]>,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), SceneError> {
        let (mut group, shine) = self.group(material, emission.as_ref())?;
        let textured =
            self.parts.looks[material.0 as usize].is_textured() || shine.is_some_and(|s| s.texture != NO);
        if !self.push(shape, shine)? {
            return if emission.is_some() { Err(SceneError::EmptyEmitter) } else { Ok(()) };
        }
        if let Some(uvs) = uvs.filter(|_| textured) {
            group.corners = index(self.parts.details.corners.len())?;
            group.uvs = index(self.parts.details.uvs.len())?;
            self.parts.details.corners.push([0, 1, 2]);
            self.parts.details.uvs.extend(uvs);
        }
        self.close(group);
        Ok(())
    }

    /// Adds a surface, and its light if it shines; not if it has no area.
    fn push(&mut self, shape: Shape, shine: Option<Shine>) -> Result<bool, SceneError> {
        if let Shape::Planar { e1, e2, .. } | Shape::Disk { e1, e2, .. } = shape {
            // In f64: the squares of small edges vanish in f32
            let area = 0.5 * e1.as_dvec3().cross(e2.as_dvec3()).length();
            if area < f64::from(MIN_AREA) {
                return Ok(false);
            }
        }
        let parts = &mut self.parts;
        let prim = parts.shapes.len();
        if prim >= MAX_SURFACES {
            return Err(SceneError::TooLarge { what: "surfaces", found: prim + 1, limit: MAX_SURFACES });
        }
        if let Some(Shine { radiance, two_sided, texture }) = shine {
            let light = Light::surface(&shape, radiance.into(), two_sided, prim as u32);
            parts.lights.push(Light { texture, ..light });
        }
        parts.shapes.push(shape);
        Ok(true)
    }
}

/// An emission whose texture is among those of the scene.
#[derive(Clone, Copy, Debug)]
struct Shine {
    radiance: Rgb,
    two_sided: bool,
    texture: u32,
}

/// A number of things as an index.
fn index(count: usize) -> Result<u32, SceneError> {
    let found = u32::try_from(count).ok().filter(|i| *i < 1 << 31);
    found.ok_or(SceneError::TooLarge { what: "corners", found: count, limit: 1 << 31 })
}

pub(crate) fn position(p: [f32; 3]) -> Result<Vec3, SceneError> {
    for value in p {
        if !value.is_finite() {
            return Err(SceneError::NotFinite { what: "a position or normal" });
        }
        if value.abs() > MAX_COORDINATE {
            return Err(SceneError::Range { what: "a position or normal", value, range: "−1e6…1e6" });
        }
    }
    Ok(p.into())
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
        let light = || Some(Emission::front([1.0; 3]));
        assert_eq!(b.mesh(&mesh, m, None), Ok(2));
        assert_eq!(b.mesh(&mesh, m, light()), Ok(2));
        let mesh = Mesh { indices: &[[0, 1, 2]], ..mesh };
        assert_eq!(b.mesh(&mesh, m, light()), Err(SceneError::EmptyEmitter));
        let scene = b.build().unwrap();
        assert_eq!((scene.surfaces(), scene.lights()), (2, 1));
    }
}
