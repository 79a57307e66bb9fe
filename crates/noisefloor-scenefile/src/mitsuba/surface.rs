//! A material as a shape wears it.

use noisefloor_ptwne::{Cover, Material, Texture};

/// A material and what covers it.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    pub(super) material: Material,
    pub(super) cover: Cover,
}

impl Surface {
    /// What reflects, and is black from behind.
    pub(super) fn one_sided(material: Material) -> Self {
        Self { material, cover: Cover { opacity: None, one_sided: true } }
    }

    /// What is seen from both sides.
    pub(super) fn two_sided(material: Material) -> Self {
        Self { material, cover: Cover::default() }
    }

    /// What Mitsuba gives shapes without a surface: grey, or, if they shine, black.
    pub(super) fn missing(shines: bool) -> Self {
        Self::one_sided(Material::diffuse([if shines { 0.0 } else { 0.5 }; 3]))
    }

    /// Whether it has a texture.
    pub(super) fn is_textured(&self) -> bool {
        let varies = |texture: &Texture| !matches!(texture, Texture::Colour(_));
        self.cover.opacity.as_ref().is_some_and(varies)
            || match &self.material {
                Material::Diffuse { albedo: texture }
                | Material::Plastic { diffuse: texture, .. }
                | Material::RoughConductor { reflectance: texture, .. }
                | Material::Conductor { reflectance: texture, .. } => varies(texture),
                _ => false,
            }
    }
}
