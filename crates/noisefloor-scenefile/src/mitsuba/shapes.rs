//! Shapes.

use super::context::Context;
use super::surface::Surface;
use super::xml::Element;
use crate::error::{LoadError, Place};
use crate::files::{self, MAX_FILE_BYTES};
use crate::mesh::{Triangles, normal_matrix, obj, ply, serialized};
use glam::{DMat3, DVec3, Vec3};
use noisefloor_ptwne::{Emission, Material, MaterialId, Mesh, SceneBuilder};
use std::collections::HashMap;

/// Materials in the scene, by the serial number of their element, and whether they are inside out.
pub(super) type Materials = HashMap<(usize, bool), MaterialId>;

impl<'d> Context<'d> {
    /// Adds a shape to the scene.
    pub(super) fn shape(
        &self,
        element: &'d Element,
        builder: &mut SceneBuilder,
        materials: &mut Materials,
    ) -> Result<(), LoadError> {
        let emission = self.emission(element)?;
        let (serial, surface) = match self.parts(element, "bsdf")?.as_slice() {
            [] => (None, Surface::missing(emission.is_some())),
            [one] => (Some(one.serial), self.surface(one)?),
            [_, second, ..] => return Err(self.bad(second, "a shape has at most one bsdf")),
        };
        let inside_out = element.kind() == "sphere" && self.is_inside_out(element)?;
        let textured = surface.is_textured();
        let material = match serial.and_then(|serial| materials.get(&(serial, inside_out))) {
            Some(known) => *known,
            None => {
                let Surface { material, cover } =
                    if inside_out { self.inside_out(element, surface) } else { surface };
                let id = builder.material_with(material, cover).map_err(self.refused(element))?;
                if let Some(serial) = serial {
                    materials.insert((serial, inside_out), id);
                }
                id
            }
        };
        let glows = emission.as_ref().is_some_and(|emission| emission.texture.is_some());

        match element.kind() {
            "obj" | "ply" | "serialized" | "rectangle" | "cube" => {
                let mesh = self.triangles(element)?;
                self.add(element, &mesh, builder, material, emission)
            }
            "disk" => {
                if textured || glows {
                    self.warn(element, "the texture is not laid on the disk in rings");
                }
                let [centre, e1, e2] = self.disk(element)?;
                builder.disk(centre, e1, e2, material, emission).map_err(self.refused(element))
            }
            "sphere" if glows => Err(self.unsupported(element, "a sphere that shines with a texture")),
            "sphere" if inside_out && emission.is_some() => {
                Err(self.unsupported(element, "a sphere that shines inwards"))
            }
            "sphere" => {
                if textured {
                    self.warn(
                        element,
                        "the texture is laid on the sphere with its top towards +y of the scene",
                    );
                }
                let (centre, radius) = self.sphere(element)?;
                builder.sphere(centre, radius, material, emission).map_err(self.refused(element))
            }
            _ => Err(self.unsupported(element, element.label())),
        }
    }

    /// The triangles of a shape, in the scene, as the renderer wants them.
    fn triangles(&self, element: &'d Element) -> Result<Triangles, LoadError> {
        let kind = element.kind();
        let (mut mesh, own_face_normals) = match kind {
            "rectangle" => (rectangle(), false),
            "cube" => (cube(), false),
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
        if flat && !polyhedron {
            mesh.normals.clear();
        }
        mesh.transform(self.transform(element, "to_world")?);
        if mesh.normals.is_empty() && !flat {
            mesh.smooth();
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
        Ok(mesh)
    }

    /// Reads the mesh that a shape names. The second result is whether the file asks for flat faces.
    fn mesh_file(&self, element: &'d Element) -> Result<(Triangles, bool), LoadError> {
        let place = self.place(element);
        let name = self.string(element, "filename")?;
        let name =
            name.ok_or_else(|| self.bad(element, format!("{} needs a `filename`", element.label())))?;
        let path = self.folder.find(name, &place)?;
        let bytes = files::read(&path, MAX_FILE_BYTES, &place)?;
        let (mesh, flat) = match element.kind() {
            "obj" => (obj::parse(&bytes, &path)?, false),
            "ply" => (ply::parse(&bytes, &path)?, false),
            _ => {
                let index = self.integer(element, "shape_index")?.unwrap_or(0);
                let index =
                    usize::try_from(index).map_err(|_| self.bad(element, "`shape_index` is negative"))?;
                serialized::parse(&bytes, index, &path)?
            }
        };
        mesh.check(&Place::file(&path))?;
        Ok((mesh, flat))
    }

    fn add(
        &self,
        element: &'d Element,
        mesh: &Triangles,
        builder: &mut SceneBuilder,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<(), LoadError> {
        let Triangles { positions, normals, uvs, indices } = mesh;
        let mesh = Mesh { positions, normals, uvs, indices };
        let left_out = builder.mesh(&mesh, material, emission).map_err(self.refused(element))?;
        if indices.is_empty() {
            self.warn(element, "the mesh has no faces");
        }
        if left_out > 0 {
            self.warn(
                element,
                format!("{left_out} of {} faces have no area and are left out", indices.len()),
            );
        }
        Ok(())
    }

    /// Centre and axes of a disk, whose front is where their cross product points.
    fn disk(&self, element: &'d Element) -> Result<[[f32; 3]; 3], LoadError> {
        let to_world = self.transform(element, "to_world")?;
        let [e1, mut e2] = [to_world.x_axis, to_world.y_axis].map(|axis| axis.truncate());
        let mut front = normal_matrix(to_world) * DVec3::Z;
        if self.boolean(element, "flip_normals", false)? {
            front = -front;
        }
        if e1.cross(e2).dot(front) < 0.0 {
            e2 = -e2;
        }
        Ok([to_world.w_axis.truncate(), e1, e2].map(|v| v.as_vec3().to_array()))
    }

    /// Centre and radius of a sphere.
    fn sphere(&self, element: &'d Element) -> Result<([f32; 3], f32), LoadError> {
        let to_world = self.transform(element, "to_world")?;
        let centre = self.point(element, "center")?.unwrap_or(DVec3::ZERO);
        let radius = self.float(element, "radius")?.unwrap_or(1.0);
        let axes = [to_world.x_axis, to_world.y_axis, to_world.z_axis].map(|axis| axis.truncate());
        let scale = axes[0].length();
        // To what six digits in a file leave of a rotation
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-4 * b.abs().max(scale * scale);
        let even = axes.iter().all(|axis| close(axis.length_squared(), scale * scale))
            && [(0, 1), (1, 2), (2, 0)].iter().all(|(a, b)| close(axes[*a].dot(axes[*b]), 0.0));
        if !even {
            return Err(self.unsupported(element, "a sphere that is stretched or sheared"));
        }
        let centre = to_world.transform_point3(centre).as_vec3().to_array();
        Ok((centre, (radius * scale) as f32))
    }

    /// Whether the front of a sphere is its inside: Mitsuba's mirrored spheres are so.
    fn is_inside_out(&self, element: &'d Element) -> Result<bool, LoadError> {
        let mirrored = DMat3::from_mat4(self.transform(element, "to_world")?).determinant() < 0.0;
        Ok(mirrored != self.boolean(element, "flip_normals", false)?)
    }

    /// The surface that looks from its front as `surface` does from its back.
    fn inside_out(&self, element: &Element, mut surface: Surface) -> Surface {
        if let Material::Glass { ior, .. } = &mut surface.material {
            *ior = ior.recip();
        }
        if surface.cover.one_sided {
            self.warn(element, "the sphere is seen from outside, too, though its surface is one-sided");
            surface.cover.one_sided = false;
        }
        surface
    }
}

/// The square from −1 to 1 in x and y; its front is +z.
fn rectangle() -> Triangles {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    Triangles {
        positions: corners.map(|[x, y]| [x, y, 0.0]).to_vec(),
        normals: vec![[0.0, 0.0, 1.0]; 4],
        uvs: corners.map(|corner| corner.map(|x| 0.5 * x + 0.5)).to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
    }
}

/// The cube from −1 to 1, with a whole texture on each side.
fn cube() -> Triangles {
    // Of each side: where u and v run to; the front is v × u
    let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z];
    let mut mesh = Triangles::default();
    for (u, v) in [(z, x), (-x, -z), (y, -z), (y, x), (y, z), (-y, x)] {
        let first = mesh.positions.len() as u32;
        let front = v.cross(u);
        for [s, t] in [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]] {
            mesh.positions.push((front + u * (2.0 * s - 1.0) + v * (2.0 * t - 1.0)).to_array());
            mesh.normals.push(front.to_array());
            mesh.uvs.push([s, t]);
        }
        mesh.indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    mesh
}
