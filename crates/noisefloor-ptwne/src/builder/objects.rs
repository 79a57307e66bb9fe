//! Objects of a builder, and their instances.

use super::input::MAX_INSTANCES;
use super::scene_builder::SceneBuilder;
use crate::accel::{self, Instance};
use crate::checks::{position, room};
use crate::error::SceneError;
use crate::math::Vec3;
use crate::parts::Object;
use glam::{DAffine3, DMat3, DVec3};

/// An object of a [`SceneBuilder`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ObjectId(u32);

impl SceneBuilder {
    /// Begins an object: the surfaces that are added up to [`SceneBuilder::end_object`] are seen only through its
    /// instances, which share them. They must not shine: a light has a place of its own, so emitters are added
    /// in the scene, for each instance.
    ///
    /// # Errors
    /// [`SceneError::Object`] if an object has begun already.
    pub fn begin_object(&mut self) -> Result<(), SceneError> {
        if self.open_object.is_some() {
            return Err(SceneError::Object("an object in an object"));
        }
        self.open_object = Some(self.parts.shapes.len() as u32);
        Ok(())
    }

    /// Ends the object.
    ///
    /// # Errors
    /// [`SceneError::Object`] if none has begun.
    pub fn end_object(&mut self) -> Result<ObjectId, SceneError> {
        let first = self.open_object.take().ok_or(SceneError::Object("the end of no object"))?;
        let surfaces = first..self.parts.shapes.len() as u32;
        let shapes = &mut self.parts.shapes[first as usize..];
        let mut object = Object { surfaces, bounds: [Vec3::ZERO; 2], origin: glam::Vec3::ZERO };
        if let Some([low, high]) = accel::bounds(&*shapes) {
            // Around the origin, so that `f32` keeps its detail
            let centre = 0.5 * (low + high);
            if centre.abs().max_element() > 0.5 * (high - low).length() {
                object.origin = centre.into();
                shapes.iter_mut().for_each(|shape| *shape = shape.translated(-object.origin));
            }
            object.bounds = [low, high].map(|corner| corner - Vec3::from(object.origin));
        }
        self.parts.objects.push(object);
        Ok(ObjectId(self.parts.objects.len() as u32 - 1))
    }

    /// Shows an object once more, moved by a matrix whose rows are given, translation last. It costs a hundred
    /// bytes, whatever is in the object. Fronts stay fronts where the matrix mirrors.
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
