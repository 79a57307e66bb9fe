//! Shapes, groups of them and their instances, and what they fill.

use super::context::Context;
use super::parts::{Attribute, Body, Surface};
use super::xml::Element;
use crate::error::{LoadError, Place};
use crate::files::MAX_FILE_BYTES;
use crate::mesh::solids::{self, Ball, Balls};
use crate::mesh::{Triangles, normal_matrix, obj, ply, serialized};
use glam::{DMat3, DMat4, DQuat, DVec3};
use noisefloor_ptwne::{Emission, Material, MaterialId, MaterialOptions, ObjectId, SceneBuilder};
use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;

/// Centre and axes of a disk, whose front is where their cross product points, and whether the angle of its
/// texture runs the other way.
type DiskFrame = ([f32; 3], [[f32; 3]; 2], bool);

impl<'d> Context<'d> {
    /// Adds a shape to the scene.
    pub(super) fn shape(&self, element: &'d Element, filling: &mut Filling<'d>) -> Result<(), LoadError> {
        match element.kind() {
            "merge" => self.merged(element)?.into_iter().try_for_each(|shape| self.shape(shape, filling)),
            // Seen only through its instances
            "shapegroup" => Ok(()),
            "instance" => self.instance(element, filling),
            _ => self.simple(element, None, filling),
        }
    }

    /// Adds a shape that is not a group; one of a group that shines as `instance` moves it.
    pub(super) fn simple(
        &self,
        element: &'d Element,
        instance: Option<DMat4>,
        filling: &mut Filling<'d>,
    ) -> Result<(), LoadError> {
        self.spend(element, element.children.len())?;
        if instance.is_some() {
            self.load.folder.build(1, &self.place(element))?;
        }
        self.no_media(element)?;
        element.ignore(&["silhouette_sampling_weight"]);
        let emission = self.emission(element, &mut filling.builder)?;
        let glows = emission.as_ref().is_some_and(|emission| emission.texture.is_some());
        let round = match element.kind() {
            // As triangles if stretched, or if light depends on where on it or comes from its inside
            "sphere" => self
                .sphere(element, instance)?
                .filter(|(_, inside_out)| emission.is_none() || !glows && !inside_out),
            _ => None,
        };
        let inside_out = round.as_ref().is_some_and(|(_, inside_out)| *inside_out);
        let (material, textured) = self.material(element, emission.is_some(), inside_out, filling)?;
        let mapped = textured || glows;

        // Only one that is seen from outside, and whose group is not shared: instances do not nest
        let plain = emission.is_none() && instance.is_none() && !filling.in_group;
        let plain = plain && !self.boolean(element, "flip_normals", false)?;

        match (element.kind(), round) {
            ("sphere", None) if plain => {
                let to_world = self.transform(element, "to_world")? * self.own_sphere(element)?;
                let place = self.place(element);
                filling.balls.add(self.load, &mut filling.builder, material, to_world, &place)
            }
            ("sphere", Some((Ball { centre, radius, axes }, _))) => {
                let added = if textured {
                    filling.builder.turned_sphere(centre, radius, axes, material, emission)
                } else {
                    filling.builder.sphere(centre, radius, material, emission)
                };
                added.map_err(self.refused(element))
            }
            ("disk", _) => {
                let (centre, axes, reversed) = self.disk(element, instance)?;
                let builder = &mut filling.builder;
                builder.disk(centre, axes, reversed, material, emission).map_err(self.refused(element))
            }
            ("obj" | "ply" | "serialized" | "rectangle" | "cube" | "sphere" | "cylinder", _) => {
                let kept = instance.and_then(|_| filling.meshes.get(&element.serial).cloned());
                let mesh = match kept {
                    Some(mesh) => mesh,
                    None => Rc::new(self.triangles(element, mapped)?),
                };
                self.load.folder.build(mesh.indices.len() as u64, &self.place(element))?;
                let Some(to_world) = instance else {
                    return self.add(element, &mesh, filling, material, emission);
                };
                filling.meshes.insert(element.serial, mesh.clone());
                let mut mesh = (*mesh).clone();
                mesh.place(to_world);
                self.add(element, &mesh, filling, material, emission)
            }
            _ => Err(self.unsupported_kind(element)),
        }
    }

    /// The material of a shape in the scene, and whether it has a texture.
    fn material(
        &self,
        element: &'d Element,
        shines: bool,
        inside_out: bool,
        filling: &mut Filling<'d>,
    ) -> Result<(MaterialId, bool), LoadError> {
        let parts = self.parts(element, "bsdf")?;
        let serial = parts.first().map(|part| part.serial);
        if let Some(known) = serial.and_then(|serial| filling.materials.get(&(serial, inside_out))) {
            return Ok(*known);
        }
        let (serial, surface) = match parts.as_slice() {
            [] => (None, Surface::missing(shines)),
            // What lets all light through can shine, as Blender writes lamps
            [one] if shines && one.kind() == "null" => {
                (None, Surface { opacity: None, ..Surface::two_sided(Material::Nothing) })
            }
            [one] => (Some(one.serial), self.surface(one)?),
            [_, second, ..] => return Err(self.bad(second, "a shape has at most one bsdf")),
        };
        let textured = surface.is_textured();
        let surface = if inside_out {
            if surface.one_sided {
                let what = "the sphere is seen from outside, too, though its surface is one-sided";
                self.approximated(element, what);
            }
            surface.inside_out().seen_from_both_sides()
        } else {
            surface
        };
        let id = self.add_surface(element, surface, &mut filling.builder)?;
        if let Some(serial) = serial {
            filling.materials.insert((serial, inside_out), (id, textured));
        }
        Ok((id, textured))
    }

    fn add_surface(
        &self,
        element: &Element,
        surface: Surface,
        builder: &mut SceneBuilder,
    ) -> Result<MaterialId, LoadError> {
        let Surface { body, opacity, one_sided, facets, alphas, relief } = surface;
        let roughness = alphas;
        let options =
            MaterialOptions { opacity, one_sided, facets, roughness, relief, ..MaterialOptions::default() };
        match body {
            Body::Plain(material) => {
                self.coat(element, &material, (options.roughness.is_some(), facets))?;
                builder.material_with(material, options).map_err(self.refused(element))
            }
            Body::Blend(parts, share) => {
                let [first, second] = *parts;
                let first = self.add_surface(element, first, builder)?;
                let second = self.add_surface(element, second, builder)?;
                builder.mixed_material(first, second, share, options).map_err(self.refused(element))
            }
        }
    }

    /// The triangles of a shape, in the scene, as the renderer wants them; with texture coordinates if it is
    /// `mapped`.
    fn triangles(&self, element: &'d Element, mapped: bool) -> Result<Triangles, LoadError> {
        let kind = element.kind();
        let (mut mesh, own_face_normals) = match kind {
            "rectangle" => (solids::rectangle(), false),
            "cube" => (solids::cube(), false),
            "sphere" => (solids::sphere(), false),
            "cylinder" => (solids::cylinder(), false),
            _ => self.mesh_file(element)?,
        };

        // Mitsuba's v counts from the top of a picture, that of the renderer from below
        let flipped = self.boolean(element, "flip_tex_coords", kind == "obj")?;
        if !flipped {
            mesh.uvs.iter_mut().for_each(|uv| uv[1] = 1.0 - uv[1]);
        }

        // Normals: those of the file, else smooth ones, else none
        let flat = self.boolean(element, "face_normals", own_face_normals)?;
        let polyhedron = matches!(kind, "rectangle" | "cube");
        let built_in = polyhedron || matches!(kind, "sphere" | "cylinder");
        if flat && !built_in {
            mesh.normals.clear();
        }
        let own = match kind {
            "sphere" => self.own_sphere(element)?,
            "cylinder" => self.own_cylinder(element)?,
            _ => DMat4::IDENTITY,
        };
        mesh.transform(self.transform(element, "to_world")? * own);
        if mesh.normals.is_empty() && !flat {
            mesh.smooth();
        }
        if mapped {
            // Mitsuba takes the weights of the second and third corner, and its v runs down
            mesh.map_each([[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]]);
        }
        if !mesh.normals.is_empty() {
            mesh.face_normals_outwards();
        }
        if self.boolean(element, "flip_normals", false)? {
            mesh.flip();
        }
        if polyhedron {
            mesh.normals.clear();
        }
        mesh.spread_face_colours();
        Ok(mesh)
    }

    /// Reads the mesh that a shape names. The second result is whether the file asks for flat faces.
    fn mesh_file(&self, element: &'d Element) -> Result<(Triangles, bool), LoadError> {
        let place = self.place(element);
        let name = self.string(element, "filename")?;
        let name =
            name.ok_or_else(|| self.bad(element, format!("{} needs a `filename`", element.species())))?;
        let path = self.load.folder.find(name, &place)?;
        let bytes = self.load.folder.read(&path, MAX_FILE_BYTES, &place)?;
        let attribute = self.attribute_of(element)?;
        let (mut mesh, flat) = match (element.kind(), &attribute) {
            ("ply", Some(attribute)) => (self.coloured(element, &bytes, &path, attribute)?, false),
            ("ply", None) => (ply::parse(&bytes, &path)?, false),
            (_, Some(attribute)) => {
                let what = format!("`{}` of a mesh that is no PLY", attribute.name);
                return Err(self.unsupported(element, what));
            }
            ("obj", None) => (obj::parse(&bytes, &path)?, false),
            _ => {
                let index = self.integer(element, "shape_index")?.unwrap_or(0);
                let index =
                    usize::try_from(index).map_err(|_| self.bad(element, "`shape_index` is negative"))?;
                serialized::parse(&self.load.folder, &bytes, index, &path)?
            }
        };
        mesh.check(&Place::file(&path))?;
        for unread in &mesh.unread {
            self.ignored(element, format!("{unread} of `{name}` is ignored"));
        }
        if let Some(angle) = self.float(element, "max_smooth_angle")? {
            self.approximated(element, format!("edges sharper than {angle}° are smoothed, too"));
        }
        Ok((mesh, flat))
    }

    fn add(
        &self,
        element: &'d Element,
        mesh: &Triangles,
        filling: &mut Filling<'d>,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), LoadError> {
        let added = mesh.add_to(&mut filling.builder, material, emission);
        let left_out = added.map_err(self.refused(element))?;
        if mesh.indices.is_empty() {
            self.ignored(element, "the mesh has no faces, as its file says");
        }
        // The poles of our own spheres have none either
        if left_out > 0 && element.kind() != "sphere" {
            let what = format!("{left_out} of {} faces have no area and are left out", mesh.indices.len());
            self.ignored(element, what);
        }
        Ok(())
    }

    /// Where a disk is, and how it is turned.
    fn disk(&self, element: &'d Element, instance: Option<DMat4>) -> Result<DiskFrame, LoadError> {
        let to_world = instance.unwrap_or_default() * self.transform(element, "to_world")?;
        let [e1, mut e2] = [to_world.x_axis, to_world.y_axis].map(|axis| axis.truncate());
        let mut front = normal_matrix(DMat3::from_mat4(to_world)) * DVec3::Z;
        if self.boolean(element, "flip_normals", false)? {
            front = -front;
        }
        let reversed = e1.cross(e2).dot(front) < 0.0;
        if reversed {
            e2 = -e2;
        }
        let array = |v: DVec3| v.as_vec3().to_array();
        Ok((array(to_world.w_axis.truncate()), [array(e1), array(e2)], reversed))
    }

    /// A sphere, and whether its front is inside; none if it is stretched or sheared.
    fn sphere(
        &self,
        element: &'d Element,
        instance: Option<DMat4>,
    ) -> Result<Option<(Ball, bool)>, LoadError> {
        let to_world = instance.unwrap_or_default() * self.transform(element, "to_world")?;
        let own = self.own_sphere(element)?;
        // Mitsuba's mirrored spheres have their front inside
        let mirrored = DMat3::from_mat4(to_world).determinant() < 0.0;
        let inside_out = mirrored != self.boolean(element, "flip_normals", false)?;
        let ball = solids::ball(to_world, own.w_axis.truncate(), own.x_axis.x);
        Ok(ball.map(|ball| (ball, inside_out)))
    }

    /// The sphere of radius 1 around the origin to that of the element's `center` and `radius`.
    fn own_sphere(&self, element: &'d Element) -> Result<DMat4, LoadError> {
        let centre = self.point(element, "center")?.unwrap_or(DVec3::ZERO);
        let radius = self.float(element, "radius")?.unwrap_or(1.0);
        Ok(DMat4::from_scale_rotation_translation(DVec3::splat(radius), DQuat::IDENTITY, centre))
    }

    /// The cylinder of radius 1 along z from 0 to 1 to that of the element's `p0`, `p1` and `radius`.
    fn own_cylinder(&self, element: &'d Element) -> Result<DMat4, LoadError> {
        let p0 = self.point(element, "p0")?.unwrap_or(DVec3::ZERO);
        let p1 = self.point(element, "p1")?.unwrap_or(DVec3::Z);
        let radius = self.float(element, "radius")?.unwrap_or(1.0);
        let axis = (p1 - p0).try_normalize();
        let axis = axis.filter(|_| radius > 0.0).ok_or_else(|| {
            self.bad(element, "a cylinder needs a `radius` above 0 and two ends that differ")
        })?;
        let scale = DVec3::new(radius, radius, (p1 - p0).length());
        Ok(DMat4::from_scale_rotation_translation(scale, DQuat::from_rotation_arc(DVec3::Z, axis), p0))
    }
}

// What shapes and groups fill.

/// The scene that is being filled.
pub(super) struct Filling<'d> {
    pub(super) builder: SceneBuilder,
    /// Materials in it, by the serial number of their element, and whether they are inside out; and whether
    /// they have a texture.
    pub(super) materials: HashMap<(usize, bool), (MaterialId, bool)>,
    /// Meshes of groups that shine, by the serial number of their element.
    pub(super) meshes: HashMap<usize, Rc<Triangles>>,
    /// Spheres that ellipsoids of a material share.
    pub(super) balls: Balls,
    /// Whether shapes are added to what the instances of a group share.
    pub(super) in_group: bool,
    /// Groups that have been shown, by the serial number of their element; none if one cannot be.
    pub(super) groups: HashMap<usize, Option<Group<'d>>>,
}

/// A group that has been shown.
#[derive(Clone, Debug)]
pub(super) struct Group<'d> {
    /// What its instances share.
    pub(super) shared: ObjectId,
    /// The shapes that shine, which they do not share.
    pub(super) shining: Vec<&'d Element>,
}

impl Filling<'_> {
    pub(super) fn new(builder: SceneBuilder) -> Self {
        let (materials, meshes, balls, groups) = Default::default();
        Self { builder, materials, meshes, balls, in_group: false, groups }
    }
}

// Groups of shapes, and their instances.

impl<'d> Context<'d> {
    /// Shows the shapes of a group, moved.
    pub(super) fn instance(&self, element: &'d Element, filling: &mut Filling<'d>) -> Result<(), LoadError> {
        let groups = self.parts(element, "shape")?;
        let [group] = groups.as_slice() else {
            return Err(self.bad(element, "an instance needs one <shape type=\"shapegroup\">, by reference"));
        };
        if group.kind() != "shapegroup" {
            return Err(self.bad(element, format!("an instance of {}; expected a shapegroup", group.label())));
        }
        let to_world = self.transform(element, "to_world")?;
        if !filling.groups.contains_key(&group.serial) {
            // What is wrong with a group is said once
            filling.groups.insert(group.serial, None);
            let made = self.group(group, filling)?;
            filling.groups.insert(group.serial, Some(made));
        }
        let Some(Some(Group { shared, shining })) = filling.groups.get(&group.serial).cloned() else {
            return Ok(());
        };
        let place = self.place(element);
        if !self.load.instance(&mut filling.builder, shared, to_world, "an instance", &place)? {
            return Ok(());
        }
        shining.iter().try_for_each(|shape| self.simple(shape, Some(to_world), filling))
    }

    /// Adds the shapes of a group that its instances share.
    fn group(&self, group: &'d Element, filling: &mut Filling<'d>) -> Result<Group<'d>, LoadError> {
        let (mut shining, mut plain) = (vec![], vec![]);
        for shape in self.merged(group)? {
            if matches!(shape.kind(), "shapegroup" | "instance") {
                return Err(self.unsupported(shape, "an instance in a group"));
            }
            let lamp = !self.parts(shape, "emitter")?.is_empty();
            if lamp { &mut shining } else { &mut plain }.push(shape);
        }
        filling.builder.begin_object().map_err(self.refused(group))?;
        filling.in_group = true;
        let added = plain.into_iter().try_for_each(|shape| self.simple(shape, None, filling));
        filling.in_group = false;
        let shared = filling.builder.end_object().map_err(self.refused(group))?;
        added.map(|()| Group { shared, shining })
    }

    /// The shapes in an element; of those that are a `merge`, the shapes in them.
    pub(super) fn merged(&self, element: &'d Element) -> Result<Vec<&'d Element>, LoadError> {
        let mut all = Vec::new();
        for shape in self.parts(element, "shape")? {
            match shape.kind() {
                "merge" => all.extend(self.nested_in(shape, || self.merged(shape))?),
                _ => all.push(shape),
            }
            self.spend(element, all.len())?;
        }
        Ok(all)
    }
}

// Attributes of meshes, which are colours at their corners or on their faces.

impl<'d> Context<'d> {
    /// The attribute that the surfaces in an element use, if they use one.
    pub(super) fn attribute_of(&self, element: &'d Element) -> Result<Option<Attribute>, LoadError> {
        if let Some(known) = self.attributes.borrow().get(&element.serial) {
            return Ok(known.clone());
        }
        self.spend(element, element.children.len())?;
        let mut found = None;
        for child in &element.children {
            let part = self.resolve(child)?;
            let attribute = match part.tag.as_str() {
                "texture" if part.kind() == "mesh_attribute" => {
                    let name = self.string(part, "name")?;
                    let name =
                        name.ok_or_else(|| self.bad(part, "a mesh attribute needs a `name`"))?.to_owned();
                    Some(Attribute { name, scale: self.float(part, "scale")?.unwrap_or(1.0) })
                }
                "bsdf" | "texture" => self.nested_in(part, || self.attribute_of(part))?,
                _ => None,
            };
            if found.is_some() && attribute.is_some() && found != attribute {
                return Err(self.unsupported(part, "a second attribute of one mesh"));
            }
            found = found.or(attribute);
        }
        self.attributes.borrow_mut().insert(element.serial, found.clone());
        Ok(found)
    }

    /// A PLY mesh with the colours of an attribute, brought into 0…1.
    pub(super) fn coloured(
        &self,
        shape: &Element,
        bytes: &[u8],
        path: &Path,
        attribute: &Attribute,
    ) -> Result<Triangles, LoadError> {
        let mut mesh = ply::parse_with(bytes, path, Some(&attribute.name))?;
        let mut outside = 0;
        for value in mesh.colours.iter_mut().chain(&mut mesh.face_colours).flatten() {
            *value *= attribute.scale as f32;
            if !(0.0..=1.0).contains(value) {
                outside += 1;
                *value = if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) };
            }
        }
        if outside > 0 {
            let what = format!("{outside} values of `{}` are outside 0…1 and are clamped", attribute.name);
            self.approximated(shape, what);
        }
        Ok(mesh)
    }
}
