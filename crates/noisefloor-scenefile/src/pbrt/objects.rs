//! Shapes in the scene, and instances of objects.

use super::reader::Reader;
use super::state::{Form, Object, Part, Wear};
use crate::error::{LoadError, Place};
use crate::mesh::Triangles;
use crate::mesh::solids::{self, Ball, ball};
use glam::{DMat4, DVec3};
use noisefloor_ptwne::{MaterialId, SceneError};

impl Reader<'_> {
    /// Shows an object where the state is. What does not shine is shared by all its instances.
    pub(super) fn instance(&mut self, name: &str, place: &Place) -> Result<(), LoadError> {
        let missing = || place.bad(format!("there is no object `{name}`"));
        let mut object = self.objects.remove(name).ok_or_else(missing)?;
        let shown = self.show(&mut object, place);
        self.objects.insert(name.to_owned(), object);
        shown
    }

    fn show(&mut self, object: &mut Object, place: &Place) -> Result<(), LoadError> {
        let refused = place.refused();
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
        if !self.load.instance(&mut self.builder, shared, to_world, "an instance", place)? {
            return Ok(());
        }
        for part in &object.parts {
            self.load.folder.build(part.form.surfaces(), &part.place)?;
            self.add(part.clone(), to_world)?;
        }
        Ok(())
    }

    /// Adds a shape to the scene, or to the object that its instances share, moved by `to_world`.
    pub(super) fn add(&mut self, part: Part, to_world: DMat4) -> Result<(), LoadError> {
        let Part { form, wear, place } = part;
        let mut mesh = match form {
            Form::Mesh(mesh) => mesh,
            Form::Ball(own, radius) => match ball(to_world * own, DVec3::ZERO, radius) {
                Some(Ball { centre, radius, axes }) => {
                    let added =
                        self.builder.turned_sphere(centre, radius, axes, wear.material, wear.emission);
                    return added.map_err(place.refused());
                }
                None => {
                    let own = own * DMat4::from_scale(DVec3::splat(radius));
                    let mut mesh = solids::sphere();
                    self.load.folder.build(mesh.indices.len() as u64, &place)?;
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
        self.balls.add(&self.load, &mut self.builder, material, to_world, place)
    }

    fn add_mesh(&mut self, mesh: &Triangles, wear: Wear, place: &Place) -> Result<(), LoadError> {
        match mesh.add_to(&mut self.builder, wear.material, wear.emission) {
            Ok(left_out) => {
                // The poles of our own round shapes have no area either
                if left_out > 0 && left_out == mesh.indices.len() {
                    self.load.ignored(place, "a shape is left out: none of its faces has an area");
                }
                Ok(())
            }
            Err(SceneError::EmptyEmitter) => {
                self.load.ignored(place, "a shape is left out: it shines, but has no area");
                Ok(())
            }
            Err(cause) => Err(place.refused()(cause)),
        }
    }
}
