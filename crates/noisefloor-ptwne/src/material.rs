//! What surfaces are made of.

use crate::error::SceneError;
use crate::math::Vec3;
use crate::texture::{Texture, check_reflectance};
use noisefloor::Rgb;

/// Smallest roughness that is treated as rough; below it a conductor is a mirror.
pub const MIN_ROUGHNESS: f32 = 1e-3;

/// What a surface is made of. All surfaces but glass look the same from both sides.
#[derive(Clone, Debug, PartialEq)]
pub enum Material {
    /// Lambertian reflection.
    Diffuse {
        /// Share of the light that is reflected, 0…1.
        albedo: Texture,
    },
    /// A perfect mirror.
    Mirror {
        /// Share of the light that is reflected, 0…1, the same at all angles.
        reflectance: Rgb,
    },
    /// A smooth dielectric boundary: unpolarised Fresnel reflection and refraction.
    ///
    /// Radiance is followed as basic radiance L/η²: exact as long as camera and emitters lie outside the glass.
    Glass {
        /// Index of refraction of the side the normal points away from, over that of the other: 1…4.
        ior: f32,
        /// Factor on refracted light at each crossing, 0…1.
        tint: Rgb,
    },
    /// A rough conductor: GGX microfacets with Smith's height-correlated masking and Schlick's Fresnel term, single
    /// scattering (Walter et al. 2007; Heitz 2014, 2018; Schlick 1994).
    RoughConductor {
        /// Reflectance at normal incidence, 0…1.
        reflectance: Texture,
        /// GGX α, 0…1; below [`MIN_ROUGHNESS`] the surface is a mirror.
        roughness: f32,
    },
}

impl Material {
    /// A diffuse material of one colour.
    pub fn diffuse(albedo: Rgb) -> Self {
        Material::Diffuse { albedo: albedo.into() }
    }

    pub(crate) fn check(&self) -> Result<(), SceneError> {
        match self {
            Material::Diffuse { albedo } => albedo.check(),
            Material::Mirror { reflectance } => check_reflectance(*reflectance),
            Material::Glass { ior, tint } => {
                // `contains` is false for NaN too
                if !(1.0..=4.0).contains(ior) {
                    let what = "an index of refraction";
                    return Err(SceneError::Range { what, value: *ior, range: "1…4" });
                }
                check_reflectance(*tint)
            }
            Material::RoughConductor { reflectance, roughness } => {
                if !(0.0..=1.0).contains(roughness) {
                    return Err(SceneError::Range { what: "a roughness", value: *roughness, range: "0…1" });
                }
                reflectance.check()
            }
        }
    }

    /// Takes the material apart for the inner loop. The colour of a texture stays with the texture.
    pub(crate) fn looks(self) -> (Looks, Option<Texture>) {
        let split = |kind, texture: Texture, value| match texture.constant() {
            Some(colour) => (Looks { kind, colour, value, textured: false }, None),
            None => (Looks { kind, colour: Vec3::ONE, value, textured: true }, Some(texture)),
        };
        match self {
            Material::Diffuse { albedo } => split(Kind::Diffuse, albedo, 0.0),
            Material::Mirror { reflectance } => split(Kind::Mirror, reflectance.into(), 0.0),
            Material::Glass { ior, tint } => split(Kind::Glass, tint.into(), ior),
            Material::RoughConductor { reflectance, roughness } => {
                let kind = if roughness < MIN_ROUGHNESS { Kind::Conductor } else { Kind::Rough };
                split(kind, reflectance, roughness)
            }
        }
    }
}

/// The kinds of scattering.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Diffuse,
    Mirror,
    Glass,
    Rough,
    /// A conductor too smooth for microfacets: a mirror with Schlick's Fresnel term.
    Conductor,
}

/// A material at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Looks {
    pub(crate) kind: Kind,
    /// Albedo, reflectance or tint.
    pub(crate) colour: Vec3,
    /// Index of refraction or roughness.
    pub(crate) value: f32,
    /// Whether `colour` must be looked up first.
    pub(crate) textured: bool,
}
