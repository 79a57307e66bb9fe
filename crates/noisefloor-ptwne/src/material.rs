//! Materials, as described by the caller and as used in the inner loop.

mod compiled;
mod layers;

pub(crate) use compiled::{Bsdf, CompiledMaterial};
pub use layers::{Dialect, Gloss, Lobes, Principled};

use crate::bsdf::Facets;
#[cfg(doc)]
use crate::bsdf::MIN_ROUGHNESS;
use crate::checks::{check_range, check_reflectance};
use crate::error::SceneError;
use crate::relief::Relief;
use crate::texture::Texture;
use noisefloor::Rgb;

/// What a surface is made of. Except for glass, both sides look the same, unless [`MaterialOptions`] says
/// otherwise.
///
/// Microfacets are GGX with Smith's height-correlated masking, single scattering (Walter et al. 2007; Heitz
/// 2014, 2018), unless [`MaterialOptions::facets`] says otherwise.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Material {
    Diffuse {
        /// Reflectance, 0…1.
        albedo: Texture,
    },
    Mirror {
        /// Reflectance at all angles, 0…1.
        reflectance: Rgb,
    },
    /// A smooth dielectric boundary: unpolarised Fresnel reflection and refraction.
    ///
    /// A path that enters a medium of index η finds radiance there that counts 1/η², and η² again where it
    /// leaves (Veach 1997, §5.2): closed glass shows no difference, a lamp inside does.
    Glass {
        /// Index of refraction on the back (where the normal does not point), over that on the front: 0.25…4.
        ior: f32,
        /// Factor on light each time it crosses the surface, 0…1.
        tint: Rgb,
    },
    /// A rough dielectric boundary of microfacets that hide each other independently, whatever
    /// [`MaterialOptions::facets`] says (Walter et al. 2007). Radiance as in [`Material::Glass`].
    RoughGlass {
        /// Index of refraction on the back (where the normal does not point), over that on the front: 0.25…4.
        ior: f32,
        /// Factor on light each time it crosses the surface, 0…1.
        tint: Rgb,
        /// α, 0…1; below [`MIN_ROUGHNESS`] it is smooth.
        roughness: f32,
    },
    /// A thin pane: one surface for both boundaries, including all reflections between them. Light passes
    /// straight through.
    ThinGlass {
        /// Index of refraction of the pane over that of its surroundings: 0.25…4.
        ior: f32,
        /// Factor on transmitted light, 0…1.
        tint: Rgb,
    },
    /// A rough conductor with Schlick's Fresnel term (1994).
    RoughConductor {
        /// Reflectance at normal incidence, 0…1.
        reflectance: Texture,
        /// GGX α, 0…1; below [`MIN_ROUGHNESS`] the surface is a mirror.
        roughness: f32,
    },
    /// A conductor with a complex index of refraction η + ik per channel, each 0…100.
    Conductor {
        eta: Rgb,
        k: Rgb,
        /// Factor on the reflection, 0…1.
        reflectance: Texture,
        /// GGX α, 0…1; below [`MIN_ROUGHNESS`] the surface is a mirror.
        roughness: f32,
    },
    /// A dielectric coat on a Lambertian base, as Mitsuba's `plastic` and `roughplastic` (Jakob 2010): light
    /// enters the coat, is reflected between base and coat any number of times, and leaves. As in Mitsuba, a
    /// rough coat loses the light that its facets mask on the inside: a white base under α = 0.2 returns four
    /// fifths.
    Plastic {
        /// Albedo of the base, 0…1.
        diffuse: Texture,
        /// Factor on the coat's reflection, 0…1.
        specular: Rgb,
        /// Index of refraction of the coat, above 1 and up to 4.
        ior: f32,
        /// GGX α of the coat, 0…1; below [`MIN_ROUGHNESS`] it is smooth.
        roughness: f32,
        /// Whether light takes on the base's colour at each reflection between base and coat, or only once.
        nonlinear: bool,
    },
    /// glTF's metallic-roughness model (glTF 2.0, appendix B): GGX whose masking and shadowing are
    /// independent, with Schlick's Fresnel term F, over 1 − F of Lambertian reflection.
    MetallicRoughness {
        /// Albedo of the dielectric and reflectance of the metal, 0…1.
        base: Texture,
        /// Green: the square root of GGX's α. Blue: the share of metal. Red is not used.
        metallic_roughness: Texture,
        /// Index of refraction of the dielectric, 1…4; glTF's default is 1.5.
        ior: f32,
    },
    /// Disney's principled surface without its transmission.
    Principled(Box<Principled>),
    /// Lobes that add up.
    Lobes(Box<Lobes>),
    /// Nothing that stops light: only what the surface emits is seen, before what lies behind it. Light
    /// samples pass it unseen, scattered rays count it as one of their segments.
    Nothing,
}

/// Opacity and sidedness of a surface, besides its [`Material`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialOptions {
    /// The mean of the channels is the probability that the surface stops a ray; other rays pass straight
    /// through. `None`: opaque everywhere.
    pub opacity: Option<Texture>,
    /// The least opacity, by the largest channel, that stops rays: where there is less, all pass, and
    /// elsewhere none. `None`: they pass at random.
    pub cutoff: Option<f32>,
    /// Whether the back absorbs all light.
    pub one_sided: bool,
    /// Whether there is no back: rays that come from there pass, as where renderers cull it.
    pub culled: bool,
    /// The microfacets of [`Material::RoughConductor`], [`Material::Conductor`], [`Material::Plastic`],
    /// [`Material::RoughGlass`] and [`Material::Lobes`].
    pub facets: Facets,
    /// α of the microfacets instead of the material's own number: red along growing u of the texture
    /// coordinates, green across it, at least [`MIN_ROUGHNESS`]. For the materials that
    /// [`MaterialOptions::facets`] is for. The coat of [`Material::Plastic`] lets through what one with the
    /// geometric mean of both would.
    pub roughness: Option<Texture>,
    /// Structure of the surface. That of a mix is also that of its parts that have none.
    pub relief: Option<Relief>,
}

impl Material {
    /// A diffuse material of one colour.
    pub fn diffuse(albedo: Rgb) -> Self {
        Material::Diffuse { albedo: albedo.into() }
    }

    fn check(&self) -> Result<(), SceneError> {
        let rough = |value: &f32| check_range("a roughness", *value, [0.0, 1.0], "0…1");
        let coat =
            |value: &f32| check_range("an index of refraction", *value, [1.0001, 4.0], "1…4, 1 excluded");
        match self {
            Material::Diffuse { albedo } => albedo.check(),
            Material::Mirror { reflectance } => check_reflectance(*reflectance),
            Material::Glass { ior, tint } | Material::ThinGlass { ior, tint } => {
                check_range("an index of refraction", *ior, [0.25, 4.0], "0.25…4")?;
                check_reflectance(*tint)
            }
            Material::RoughGlass { ior, tint, roughness } => {
                check_range("an index of refraction", *ior, [0.25, 4.0], "0.25…4")?;
                rough(roughness)?;
                check_reflectance(*tint)
            }
            Material::RoughConductor { reflectance, roughness } => {
                rough(roughness)?;
                reflectance.check()
            }
            Material::Conductor { eta, k, reflectance, roughness } => {
                for value in eta.iter().chain(k) {
                    check_range("an index of refraction", *value, [0.0, 100.0], "0…100")?;
                }
                rough(roughness)?;
                reflectance.check()
            }
            Material::Plastic { diffuse, specular, ior, roughness, .. } => {
                coat(ior)?;
                rough(roughness)?;
                check_reflectance(*specular)?;
                diffuse.check()
            }
            Material::MetallicRoughness { base, metallic_roughness, ior } => {
                check_range("an index of refraction", *ior, [1.0, 4.0], "1…4")?;
                metallic_roughness.check()?;
                base.check()
            }
            Material::Principled(principled) => principled.check(),
            Material::Lobes(lobes) => lobes.check(),
            Material::Nothing => Ok(()),
        }
    }
}

impl MaterialOptions {
    fn check(&self) -> Result<(), SceneError> {
        self.opacity.as_ref().map_or(Ok(()), Texture::check)?;
        if self.cutoff.is_some_and(f32::is_nan) {
            return Err(SceneError::NotFinite { what: "the cutoff of an opacity" });
        }
        self.roughness.as_ref().map_or(Ok(()), Texture::check)?;
        self.relief.as_ref().map_or(Ok(()), Relief::check)
    }
}
