//! The builder.

use super::input::{Emission, MAX_INSTANCES, MAX_SURFACES, MIN_AREA, MaterialId, Mesh};
use crate::accel::{self, Instance, Shape, Surface};
use crate::bsdf::Coat;
use crate::camera::{Camera, Optics};
use crate::checks::{MAX_COORDINATE, check_radiance, check_range, position, room};
use crate::environment::{Environment, EnvironmentMap};
use crate::error::SceneError;
use crate::geometry::{Group, NO, RINGS, RINGS_REVERSED};
use crate::light::{Light, LightShape, Punctual};
use crate::material::{CompiledMaterial, Material, MaterialOptions};
use crate::math::Vec3;
use crate::parts::{Object, Parts, Surroundings};
use crate::scene::Scene;
use crate::texture::Texture;
use glam::{DAffine3, DMat3, DVec3};
use noisefloor::Rgb;
use std::sync::Arc;

/// Collects the parts of a scene, and checks each one as it is added.
///
/// ```
/// use noisefloor_ptwne::{Camera, Emission, Environment, Material, SceneBuilder};
/// let (eye, target, up) = ([0.0, 1.0, 4.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]);
/// let camera = Camera { eye, target, up, vertical_fov: 40.0 };
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
    pub(super) parts: Parts,
    pub(super) coats: Vec<Arc<Coat>>,
    /// The first surface of the object that has begun.
    pub(super) open_object: Option<u32>,
}

impl SceneBuilder {
    /// An empty scene. The name appears in reports.
    pub fn new(name: impl Into<String>, camera: Camera) -> Result<Self, SceneError> {
        camera.check()?;
        Ok(Self { name: name.into(), camera, parts: Parts::default(), coats: vec![], open_object: None })
    }

    /// Sets how the camera projects, besides its field of view.
    pub fn optics(&mut self, optics: Optics) -> Result<(), SceneError> {
        optics.check()?;
        self.parts.optics = optics;
        Ok(())
    }

    /// Surrounds the scene with a sky, which replaces earlier surroundings. By default, they are black.
    ///
    /// # Errors
    /// [`SceneError`] if a radiance is negative or not finite, or the sun's size is out of range.
    pub fn environment(&mut self, environment: Environment) -> Result<(), SceneError> {
        environment.check()?;
        self.parts.surroundings = Some(Surroundings::Sky(environment));
        Ok(())
    }

    /// Surrounds the scene with an image, which replaces earlier surroundings.
    ///
    /// # Errors
    /// [`SceneError`] if the image has the wrong number of pixels, a radiance is negative or not finite, or
    /// the matrix is no rotation.
    pub fn environment_map(&mut self, map: EnvironmentMap) -> Result<(), SceneError> {
        map.check()?;
        self.parts.surroundings = Some(Surroundings::Map(map));
        Ok(())
    }

    /// Adds a light without size.
    pub fn punctual(&mut self, light: Punctual) -> Result<(), SceneError> {
        self.parts.lights.push(Light::punctual(light)?);
        Ok(())
    }

    /// Adds a [`Punctual::Projector`] with its picture, whose channels are in 0…1; other lights without size
    /// take no notice of the picture.
    pub fn projector(&mut self, light: Punctual, picture: Texture) -> Result<(), SceneError> {
        let mut light = Light::punctual(light)?;
        if matches!(light.shape, LightShape::Projector { .. }) {
            picture.check()?;
            light.texture = index(self.parts.emission_textures.len())?;
            self.parts.emission_textures.push(picture);
        }
        self.parts.lights.push(light);
        Ok(())
    }

    /// Adds the points `corner` + u·`e1` + v·`e2` for u, v in 0…1. Texture coordinates run along the edges in
    /// scene units, so that patterns have the same size on all parallelograms.
    ///
    /// # Errors
    /// [`SceneError`] if a number is not finite or too large, the material is of another builder, or an
    /// emitter has no area.
    pub fn parallelogram(
        &mut self,
        corner: [f32; 3],
        e1: [f32; 3],
        e2: [f32; 3],
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), SceneError> {
        let [u, v] = [e1, e2].map(|edge| glam::Vec3::from(edge).length());
        let uvs = [[0.0, 0.0], [u, 0.0], [0.0, v]];
        self.mapped_parallelogram(corner, [e1, e2], uvs, material, emission)
    }

    /// As [`SceneBuilder::parallelogram`], with the texture coordinates of the corner and of the ends of its edges.
    pub fn mapped_parallelogram(
        &mut self,
        corner: [f32; 3],
        [e1, e2]: [[f32; 3]; 2],
        uvs: [[f32; 2]; 3],
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), SceneError> {
        let [corner, e1, e2] = [position(corner)?, position(e1)?, position(e2)?];
        if !uvs.iter().flatten().all(|x| x.is_finite()) {
            return Err(SceneError::NotFinite { what: "a texture coordinate" });
        }
        self.single(Shape::Planar { corner, e1, e2, whole: true }, Some(uvs), NO, material, emission)
    }

    /// Adds an ellipse: `centre` + a·`e1` + b·`e2` for a² + b² ≤ 1. Texture coordinates run in rings: u = √(a² + b²), and
    /// v = 1 − φ/2π, where φ is the angle of (a, b); φ/2π if `reversed`.
    pub fn disk(
        &mut self,
        centre: [f32; 3],
        [e1, e2]: [[f32; 3]; 2],
        reversed: bool,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), SceneError> {
        let [centre, e1, e2] = [position(centre)?, position(e1)?, position(e2)?];
        let frame = if reversed { RINGS_REVERSED } else { RINGS };
        self.single(Shape::Disk { centre, e1, e2 }, None, frame, material, emission)
    }

    /// Adds a sphere. Texture coordinates are azimuth and polar angle in 0…1; v = 1 is the top.
    ///
    /// # Errors
    /// [`SceneError`] if a number is not finite or too large, the radius is not in 1e-9…1e8, or the material
    /// is of another builder.
    pub fn sphere(
        &mut self,
        centre: [f32; 3],
        radius: f32,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), SceneError> {
        let centre = position(centre)?;
        check_range("the radius of a sphere", radius, [1e-9, MAX_COORDINATE], "1e-9…1e8")?;
        self.single(Shape::Sphere { centre, radius }, None, NO, material, emission)
    }

    /// As [`SceneBuilder::sphere`], with axes of length 1 for its texture coordinates: the second points to
    /// the top, v = 1, and u runs from minus the first over minus the third.
    pub fn turned_sphere(
        &mut self,
        centre: [f32; 3],
        radius: f32,
        axes: [[f32; 3]; 3],
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), SceneError> {
        for axis in axes {
            position(axis)?;
        }
        let centre = position(centre)?;
        check_range("the radius of a sphere", radius, [1e-9, MAX_COORDINATE], "1e-9…1e8")?;
        let frame = index(self.parts.geometry.frames.len())?;
        self.parts.geometry.frames.push(axes.map(glam::Vec3A::from_array));
        self.single(Shape::Sphere { centre, radius }, None, frame, material, emission)
    }

    /// Adds the triangles of a mesh that have an area, and returns the number of those that have none.
    ///
    /// # Errors
    /// [`SceneError`] if a number is not finite or too large, an index or a length does not fit, the material
    /// is of another builder, or the mesh is an emitter and has no area at all.
    pub fn mesh(
        &mut self,
        mesh: &Mesh<'_>,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<usize, SceneError> {
        mesh.check()?;
        let rows =
            [mesh.normals.len(), mesh.uvs.len(), mesh.colours.len(), mesh.alphas.len(), mesh.tangents.len()];
        let with_vertices = rows != [0; 5];
        let (mut group, group_emission) = self.group(material, emission.as_ref())?;
        if with_vertices {
            let vertices = &mut self.parts.geometry.vertices;
            group.corners = index(vertices.corners.len())?;
            let unit =
                |n: &[f32; 3]| glam::Vec3::from(*n).as_dvec3().normalize_or_zero().as_vec3().to_array();
            group.normals = append(&mut vertices.normals, mesh.normals.iter().map(unit))?;
            group.uvs = append(&mut vertices.uvs, mesh.uvs.iter().copied())?;
            if group.uvs != NO {
                group.second_uvs = append(&mut vertices.uvs, mesh.second_uvs.iter().copied())?;
            }
            group.colours = append(&mut vertices.colours, mesh.colours.iter().copied())?;
            group.alphas = append(&mut vertices.alphas, mesh.alphas.iter().copied())?;
            group.tangents = append(&mut vertices.tangents, mesh.tangents.iter().copied())?;
        }
        let surfaces = self.parts.surfaces.len() + mesh.indices.len();
        if surfaces > MAX_SURFACES {
            return Err(SceneError::TooLarge { what: "surfaces", found: surfaces, limit: MAX_SURFACES });
        }
        room(&mut self.parts.surfaces, mesh.indices.len())?;
        room(&mut self.parts.geometry.group_of, mesh.indices.len())?;
        if with_vertices {
            room(&mut self.parts.geometry.vertices.corners, mesh.indices.len())?;
        }
        let mut left_out = 0;
        for triangle in mesh.indices {
            let [a, b, c] = triangle.map(|i| glam::Vec3::from(mesh.positions[i as usize]));
            let shape = Shape::Planar { corner: a, e1: b - a, e2: c - a, whole: false };
            if self.push(shape, group_emission)? {
                if with_vertices {
                    self.parts.geometry.vertices.corners.push(*triangle);
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

    pub fn build(self) -> Result<Scene, SceneError> {
        if self.open_object.is_some() {
            return Err(SceneError::Object("an object without its end"));
        }
        Scene::new(self.name, self.camera, self.parts)
    }

    /// A group for the surfaces to be added next, and what they emit.
    fn group(
        &mut self,
        material: MaterialId,
        emission: Option<&Emission>,
    ) -> Result<(Group, Option<GroupEmission>), SceneError> {
        if material.0 as usize >= self.parts.materials.len() {
            return Err(SceneError::Material(material.0));
        }
        if let Some(emission) = emission {
            if self.open_object.is_some() {
                return Err(SceneError::Object("an emitter in an object"));
            }
            check_radiance(emission.radiance)?;
            if let Some(texture) = &emission.texture {
                texture.check()?;
            }
        }
        let group_emission = emission.filter(|e| e.radiance != [0.0; 3]).map(|e| GroupEmission {
            radiance: e.radiance,
            two_sided: e.two_sided,
            texture: e.texture.as_ref().map_or(NO, |texture| {
                self.parts.emission_textures.push(texture.clone());
                self.parts.emission_textures.len() as u32 - 1
            }),
        });
        let light = if group_emission.is_some() { index(self.parts.lights.len())? } else { NO };
        let first = index(self.parts.surfaces.len())?;
        Ok((Group::new(first, material.0, light), group_emission))
    }

    /// Adds the group, if it has got any surfaces.
    fn close(&mut self, group: Group) {
        if self.parts.surfaces.len() > group.first as usize {
            let number = self.parts.geometry.groups.len() as u32;
            self.parts.geometry.groups.push(group);
            self.parts.geometry.group_of.resize(self.parts.surfaces.len(), number);
        }
    }

    /// Adds a surface that is a group by itself, with texture coordinates at the ends of its edges.
    fn single(
        &mut self,
        shape: Shape,
        uvs: Option<[[f32; 2]; 3]>,
        frame: u32,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), SceneError> {
        let (mut group, group_emission) = self.group(material, emission.as_ref())?;
        group.frame = frame;
        let material = &self.parts.materials[material.0 as usize];
        let textured = material.is_textured() || group_emission.is_some_and(|e| e.texture != NO);
        if !self.push(shape, group_emission)? {
            return if emission.is_some() { Err(SceneError::EmptyEmitter) } else { Ok(()) };
        }
        if let Some(uvs) = uvs.filter(|_| textured) {
            group.corners = index(self.parts.geometry.vertices.corners.len())?;
            group.uvs = index(self.parts.geometry.vertices.uvs.len())?;
            self.parts.geometry.vertices.corners.push([0, 1, 2]);
            self.parts.geometry.vertices.uvs.extend(uvs);
        }
        self.close(group);
        Ok(())
    }

    /// Adds a surface, and its light if it is an emitter. Returns whether it has an area; otherwise nothing
    /// is added.
    fn push(&mut self, shape: Shape, group_emission: Option<GroupEmission>) -> Result<bool, SceneError> {
        if let Shape::Planar { e1, e2, .. } | Shape::Disk { e1, e2, .. } = shape {
            // In f64, since the squares of short edges vanish in f32
            let area = 0.5 * e1.as_dvec3().cross(e2.as_dvec3()).length();
            if area < f64::from(MIN_AREA) {
                return Ok(false);
            }
        }
        let parts = &mut self.parts;
        let prim = parts.surfaces.len();
        if prim >= MAX_SURFACES {
            return Err(SceneError::TooLarge { what: "surfaces", found: prim + 1, limit: MAX_SURFACES });
        }
        if let Some(GroupEmission { radiance, two_sided, texture }) = group_emission {
            room(&mut parts.lights, 1)?;
            let light = Light::surface(&shape, radiance.into(), two_sided, prim as u32);
            parts.lights.push(Light { texture, ..light });
        }
        room(&mut parts.surfaces, 1)?;
        parts.surfaces.push(Surface { shape, prim: prim as u32 });
        Ok(true)
    }
}

/// What the surfaces of a group emit; the texture is an index of the scene's emission textures.
#[derive(Clone, Copy, Debug)]
struct GroupEmission {
    radiance: Rgb,
    two_sided: bool,
    texture: u32,
}

/// Adds what corners of a mesh have, and returns the index of the first; [`NO`] if they have nothing.
fn append<T>(to: &mut Vec<T>, rows: impl ExactSizeIterator<Item = T>) -> Result<u32, SceneError> {
    if rows.len() == 0 {
        return Ok(NO);
    }
    let first = index(to.len())?;
    room(to, rows.len())?;
    to.extend(rows);
    Ok(first)
}

/// A count as an index.
fn index(count: usize) -> Result<u32, SceneError> {
    let found = u32::try_from(count).ok().filter(|i| *i < 1 << 31);
    found.ok_or(SceneError::TooLarge { what: "corners", found: count, limit: 1 << 31 })
}

// Materials of a builder.

impl SceneBuilder {
    /// Adds a material that is opaque and two-sided.
    pub fn material(&mut self, material: Material) -> Result<MaterialId, SceneError> {
        self.material_with(material, MaterialOptions::default())
    }

    /// Adds a material that may be transparent in parts, or one-sided.
    ///
    /// # Errors
    /// [`SceneError`] if a reflectance, index of refraction or roughness is out of range, or an image has the
    /// wrong number of pixels.
    pub fn material_with(
        &mut self,
        material: Material,
        options: MaterialOptions,
    ) -> Result<MaterialId, SceneError> {
        self.parts.materials.push(CompiledMaterial::new(material, options, &mut self.coats)?);
        Ok(MaterialId(self.parts.materials.len() as u32 - 1))
    }

    /// Adds a material that is `share` of the second one (the mean of the channels) and the rest of the
    /// first. Their opacities do not count, only that of `options`.
    pub fn mixed_material(
        &mut self,
        first: MaterialId,
        second: MaterialId,
        share: Texture,
        options: MaterialOptions,
    ) -> Result<MaterialId, SceneError> {
        self.mix([first, second], share, false, options)
    }

    /// Adds a material under a coat, as glTF's clearcoat: a `share` of 1 is a coat that reflects as `coat` does,
    /// times Schlick's Fresnel term of an index of refraction of 1.5 at the angle of view; the rest is `base`.
    /// Opacities as in [`SceneBuilder::mixed_material`].
    pub fn coated_material(
        &mut self,
        base: MaterialId,
        coat: MaterialId,
        share: Texture,
        options: MaterialOptions,
    ) -> Result<MaterialId, SceneError> {
        self.mix([base, coat], share, true, options)
    }

    fn mix(
        &mut self,
        parts: [MaterialId; 2],
        share: Texture,
        coat: bool,
        options: MaterialOptions,
    ) -> Result<MaterialId, SceneError> {
        if let Some(MaterialId(id)) = parts.iter().find(|id| id.0 as usize >= self.parts.materials.len()) {
            return Err(SceneError::Material(*id));
        }
        self.parts.materials.push(CompiledMaterial::mix(parts.map(|id| id.0), share, coat, options)?);
        Ok(MaterialId(self.parts.materials.len() as u32 - 1))
    }
}

// Objects of a builder, and their instances.

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ObjectId(u32);

impl SceneBuilder {
    /// Begins an object: the surfaces that are added up to [`SceneBuilder::end_object`] are seen only through its
    /// instances, which share them. They must not shine: a light has a place of its own, so emitters are added
    /// in the scene, for each instance.
    pub fn begin_object(&mut self) -> Result<(), SceneError> {
        if self.open_object.is_some() {
            return Err(SceneError::Object("an object in an object"));
        }
        self.open_object = Some(self.parts.surfaces.len() as u32);
        Ok(())
    }

    pub fn end_object(&mut self) -> Result<ObjectId, SceneError> {
        let first = self.open_object.take().ok_or(SceneError::Object("the end of no object"))?;
        let surfaces = first..self.parts.surfaces.len() as u32;
        let inside = &mut self.parts.surfaces[first as usize..];
        let mut object = Object { surfaces, bounds: [Vec3::ZERO; 2], origin: glam::Vec3::ZERO };
        if let Some([low, high]) = accel::bounds(inside.iter().map(|surface| &surface.shape)) {
            // Around the origin, so that `f32` keeps its detail
            let centre = 0.5 * (low + high);
            if centre.abs().max_element() > 0.5 * (high - low).length() {
                object.origin = centre.into();
                inside
                    .iter_mut()
                    .for_each(|surface| surface.shape = surface.shape.translated(-object.origin));
            }
            object.bounds = [low, high].map(|corner| corner - Vec3::from(object.origin));
        }
        self.parts.objects.push(object);
        Ok(ObjectId(self.parts.objects.len() as u32 - 1))
    }

    /// Shows an object once more, moved by a matrix whose rows are given, translation last. It costs two
    /// hundred bytes, whatever is in the object. Fronts stay fronts where the matrix mirrors.
    ///
    /// # Errors
    /// [`SceneError::Singular`] if the matrix flattens the object, or is too near to one that does for `f32`;
    /// [`SceneError`] if a number is not finite or too large, the object is of another builder, an object has
    /// begun and not ended, or there are more than [`MAX_INSTANCES`].
    pub fn instance(&mut self, object: ObjectId, to_world: [[f64; 4]; 3]) -> Result<(), SceneError> {
        if self.open_object.is_some() {
            return Err(SceneError::Object("an instance in an object"));
        }
        let Some(shared) = self.parts.objects.get(object.0 as usize) else {
            return Err(SceneError::Object("an instance of an object that does not exist in this builder"));
        };
        let found = self.parts.instances.len() + 1;
        if found > MAX_INSTANCES {
            return Err(SceneError::TooLarge { what: "instances", found, limit: MAX_INSTANCES });
        }
        if !to_world.iter().flatten().all(|x| x.is_finite()) {
            return Err(SceneError::NotFinite { what: "the matrix of an instance" });
        }
        if shared.surfaces.is_empty() {
            return Ok(());
        }
        let column = |i: usize| DVec3::new(to_world[0][i], to_world[1][i], to_world[2][i]);
        let [x, y, z, at] = [0, 1, 2, 3].map(column);
        let matrix = DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), at)
            * DAffine3::from_translation(shared.origin.as_dvec3());
        let instance = Instance::new(object.0, matrix).ok_or(SceneError::Singular)?;
        let [middle, half] = instance.around(shared.bounds);
        position((middle - half).to_array())?;
        position((middle + half).to_array())?;
        room(&mut self.parts.instances, 1)?;
        self.parts.instances.push(instance);
        Ok(())
    }
}
