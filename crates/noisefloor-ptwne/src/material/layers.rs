//! Materials that are sums of lobes.

use super::Material;
use crate::bsdf::MIN_ROUGHNESS;
use crate::checks::check_range;
use crate::error::SceneError;
use crate::texture::Texture;
use std::f32::consts::FRAC_PI_2;

/// A sum of diffuse reflection, diffuse transmission and microfacets, as the `matte`, `plastic`, `uber`,
/// `substrate` and `translucent` of pbrt's version 3 and the `diffusetransmission` of version 4 (Pharr,
/// Jakob, Humphreys 2016, §8.4 and §9.2). The facets of a [`Gloss::Dielectric`] take nothing from the rest:
/// the sum can be more light than comes. All black by default.
#[derive(Clone, Debug, PartialEq)]
pub struct Lobes {
    /// Albedo of the reflection, 0…1.
    pub diffuse: Texture,
    /// Albedo of the transmission, 0…1.
    pub through: Texture,
    /// Factor on the facets' reflection, or what they reflect at normal incidence, by `gloss`: 0…1.
    pub specular: Texture,
    /// Factor on a smooth reflection beside that of the facets, 0…1; none with [`Gloss::AshikhminShirley`].
    pub mirror: Texture,
    pub gloss: Gloss,
    /// Standard deviation of the slopes of the diffuse surface in radians, 0…π/2 (Oren, Nayar 1994); 0 is
    /// Lambertian. [`Gloss::AshikhminShirley`] has none.
    pub sigma: f32,
    /// GGX α of the facets, [`MIN_ROUGHNESS`]…1.
    pub roughness: f32,
}

impl From<Lobes> for Material {
    fn from(lobes: Lobes) -> Self {
        Self::Lobes(Box::new(lobes))
    }
}

impl Default for Lobes {
    fn default() -> Self {
        let gloss = Gloss::Dielectric { ior: 1.5 };
        let [diffuse, through, specular, mirror] = std::array::from_fn(|_| Texture::Colour([0.0; 3]));
        Self { diffuse, through, specular, mirror, gloss, sigma: 0.0, roughness: 1.0 }
    }
}

/// How the microfacets of [`Material::Lobes`] reflect.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Gloss {
    /// As the boundary of a dielectric.
    Dielectric {
        /// Index of refraction of what lies below, over that above: 0.25…4. Below 1, light that comes flatly
        /// is reflected totally.
        ior: f32,
    },
    /// By Schlick's term and without masking; the diffuse reflection gets what they leave (Ashikhmin, Shirley
    /// 2000, with GGX).
    AshikhminShirley,
}

/// Disney's principled surface (Burley 2012, 2015) without its transmission: Burley's diffuse reflection,
/// from which nothing is taken, and microfacets of GGX with independent masking and shadowing. As in the
/// renderers that have it, the sum can be more light than comes.
#[derive(Clone, Debug, PartialEq)]
pub struct Principled {
    /// Albedo of the dielectric and reflectance of the metal, 0…1.
    pub base: Texture,
    /// Green: the square root of α. Blue: the share of metal. Red is not used.
    pub metallic_roughness: Texture,
    /// Index of refraction of the dielectric, 1…4.
    pub ior: f32,
    /// How much longer than wide highlights are across growing u, 0…1: α is divided by √(1 −
    /// 0.9·`anisotropic`) along u, and multiplied with it across.
    pub anisotropic: f32,
    /// How far the dielectric's reflection has the hue of the base, 0…1.
    pub specular_tint: f32,
    /// Additional reflection at grazing angles, 0…1.
    pub sheen: f32,
    /// How far it has the hue of the base, 0…1.
    pub sheen_tint: f32,
    /// Share of the diffuse reflection that is flat, as if light were scattered below the surface, 0…1.
    pub flatness: f32,
    /// Strength of a second reflection with long tails, 0…1.
    pub clearcoat: f32,
    /// Its gloss, 0…1.
    pub clearcoat_gloss: f32,
    /// Whose formulas, where they differ.
    pub dialect: Dialect,
}

/// A renderer whose principled surface is meant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Dialect {
    /// Mitsuba 3: `principled`.
    #[default]
    Mitsuba,
    /// Pbrt, version 3: `disney`. Its clearcoat is divided by 4·cos θₒ·cos θᵢ, and of metal only the metal
    /// is tinted.
    Pbrt,
}

impl From<Principled> for Material {
    fn from(principled: Principled) -> Self {
        Self::Principled(Box::new(principled))
    }
}

impl Default for Principled {
    fn default() -> Self {
        Self {
            base: Texture::Colour([0.5; 3]),
            metallic_roughness: Texture::Colour([1.0, 0.5, 0.0]),
            ior: 1.5,
            anisotropic: 0.0,
            specular_tint: 0.0,
            sheen: 0.0,
            sheen_tint: 0.0,
            flatness: 0.0,
            clearcoat: 0.0,
            clearcoat_gloss: 0.0,
            dialect: Dialect::default(),
        }
    }
}

impl Principled {
    pub(super) fn check(&self) -> Result<(), SceneError> {
        check_range("an index of refraction", self.ior, [1.0, 4.0], "1…4")?;
        for (what, value) in [
            ("an anisotropy", self.anisotropic),
            ("a tint", self.specular_tint),
            ("a sheen", self.sheen),
            ("a tint", self.sheen_tint),
            ("a flatness", self.flatness),
            ("a clearcoat", self.clearcoat),
            ("the gloss of a clearcoat", self.clearcoat_gloss),
        ] {
            check_range(what, value, [0.0, 1.0], "0…1")?;
        }
        self.metallic_roughness.check()?;
        self.base.check()
    }
}

impl Lobes {
    pub(super) fn check(&self) -> Result<(), SceneError> {
        let Self { diffuse, through, specular, mirror, gloss, sigma, roughness } = self;
        if let Gloss::Dielectric { ior } = gloss {
            check_range("an index of refraction", *ior, [0.25, 4.0], "0.25…4")?;
        }
        check_range("a deviation of slopes", *sigma, [0.0, FRAC_PI_2], "0…π/2")?;
        check_range("a roughness", *roughness, [MIN_ROUGHNESS, 1.0], "0.001…1")?;
        diffuse.check()?;
        through.check()?;
        specular.check()?;
        mirror.check()
    }
}
