//! Shapes in the scene, and instances of objects.

use super::reader::Reader;
use super::state::{Form, Object, Part, Wear};
use crate::error::{LoadError, Place};
use crate::mesh::{Triangles, rows, solids};
use glam::{DMat3, DMat4, DVec3};
use noisefloor_ptwne::{MaterialId, SceneError};

impl Reader<'_> {
    /// Shows an object where the state is. What does not shine is shared by all its instances.
    pub(super) fn instance(&mut self, name: &str, place: &Place) -> Result<(), LoadError> {
        let missing = || place.clone().bad(format!("there is no object `{name}`"));
        let mut object = self.objects.remove(name).ok_or_else(missing)?;
        let shown = self.show(&mut object, place);
        self.objects.insert(name.to_owned(), object);
        shown
    }

    fn show(&mut self, object: &mut Object, place: &Place) -> Result<(), LoadError> {
        let refused = Self::refused(place);
        let shared = match object.shared {
            Some(shared) => shared,
            None => {
                let parts = std::mem::take(&mut object.parts);
                let (shining, plain): (Vec<Part>, _) =
                    parts.into_iter().partition(|part| part.wear.emission.is_some());
                object.parts = shining;
                self.builder.begin_object().map_err(&refused)?;
                let mut added = Ok(());
                for part in plain {
                    added = added.and_then(|()| self.add(part, DMat4::IDENTITY));
                }
                let shared = self.builder.end_object().map_err(&refused)?;
                object.shared = Some(shared);
                added?;
                shared
            }
        };
        let to_world = self.state.to_world;
        match self.builder.instance(shared, rows(to_world)) {
            Ok(()) => {}
            Err(SceneError::Singular) => {
                self.ignored(place, "an instance is left out: its transform is singular");
                return Ok(());
            }
            Err(cause) => return Err(refused(cause)),
        }
        for part in &object.parts {
            self.folder.build(part.form.surfaces(), &part.place)?;
            self.add(part.clone(), to_world)?;
        }
        Ok(())
    }

    /// Adds a shape to the scene, or to the object that its instances share, moved by `to_world`.
    pub(super) fn add(&mut self, part: Part, to_world: DMat4) -> Result<(), LoadError> {
        let Part { form, wear, place } = part;
        let mut mesh = match form {
            Form::Mesh(mesh) => mesh,
            Form::Ball(own, radius) => match ball(to_world * own, radius) {
                Some(Ball { centre, radius, axes }) => {
                    let added =
                        self.builder.turned_sphere(centre, radius, axes, wear.material, wear.emission);
                    return added.map_err(Self::refused(&place));
                }
                None => {
                    let own = own * DMat4::from_scale(DVec3::splat(radius));
                    let mut mesh = solids::sphere();
                    self.folder.build(mesh.indices.len() as u64, &place)?;
                    mesh.place(own);
                    mesh
                }
            },
        };
        if to_world != DMat4::IDENTITY {
            mesh.place(to_world);
        }
        self.add_mesh(&mesh, wear, &place)
    }

    /// Adds the sphere of radius 1 around the origin, stretched: an instance of one that all of a material share.
    pub(super) fn ellipsoid(
        &mut self,
        to_world: DMat4,
        material: MaterialId,
        place: &Place,
    ) -> Result<(), LoadError> {
        let shared = self.balls.get(&material).copied();
        match solids::ellipsoid(&mut self.builder, shared, material, to_world) {
            Ok(ball) => {
                self.balls.insert(material, ball);
                Ok(())
            }
            Err(SceneError::Singular) => {
                self.ignored(place, "a sphere is left out: its transform is singular");
                Ok(())
            }
            Err(cause) => Err(LoadError::Scene { place: place.clone(), cause }),
        }
    }

    fn add_mesh(&mut self, mesh: &Triangles, wear: Wear, place: &Place) -> Result<(), LoadError> {
        match mesh.add_to(&mut self.builder, wear.material, wear.emission) {
            Ok(left_out) => {
                // The poles of our own round shapes have no area either
                if left_out > 0 && left_out == mesh.indices.len() {
                    self.ignored(place, "a shape is left out: none of its faces has an area");
                }
                Ok(())
            }
            Err(SceneError::EmptyEmitter) => {
                self.ignored(place, "a shape is left out: it shines, but has no area");
                Ok(())
            }
            Err(cause) => Err(LoadError::Scene { place: place.clone(), cause }),
        }
    }
}

/// A sphere as the renderer takes it.
pub(super) struct Ball {
    centre: [f32; 3],
    radius: f32,
    axes: [[f32; 3]; 3],
}

/// A sphere around the origin, moved; none if that stretches it.
pub(super) fn ball(to_world: DMat4, radius: f64) -> Option<Ball> {
    let axes = DMat3::from_mat4(to_world);
    let scale = axes.x_axis.length();
    let off = (axes.transpose() * axes - DMat3::IDENTITY * (scale * scale)).to_cols_array();
    let even = off.iter().all(|x| x.abs() <= 1e-4 * scale * scale) && scale > 0.0;
    let centre = to_world.w_axis.truncate().as_vec3().to_array();
    // u runs around z from +x over +y; v = 1 is +z in pbrt, too
    let [x, y, z] = [axes.x_axis, axes.y_axis, axes.z_axis].map(|axis| (axis / scale).as_vec3());
    let axes = [-x, z, -y].map(|axis| axis.to_array());
    even.then_some(Ball { centre, radius: (radius * scale) as f32, axes })
}
