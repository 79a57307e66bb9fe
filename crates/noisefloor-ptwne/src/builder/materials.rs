//! Materials of a builder.

use super::input::MaterialId;
use super::scene_builder::SceneBuilder;
use crate::error::SceneError;
use crate::material::{CompiledMaterial, Material, MaterialOptions};
use crate::texture::Texture;

impl SceneBuilder {
    /// Adds a material that is opaque and two-sided.
    ///
    /// # Errors
    /// As [`SceneBuilder::material_with`].
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
    ///
    /// # Errors
    /// [`SceneError`] if a material is of another builder, or a share is not in 0…1.
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
    ///
    /// # Errors
    /// As [`SceneBuilder::mixed_material`].
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
