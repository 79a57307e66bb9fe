//! What surfaces are made of.

use crate::bsdf::{Coat, Fresnel, Inside};
use crate::error::SceneError;
use crate::math::Vec3;
use crate::texture::{Texture, check_reflectance};
use noisefloor::Rgb;
use std::sync::Arc;

/// Smallest roughness (GGX α) that is treated as rough; below it a surface is a mirror.
pub const MIN_ROUGHNESS: f32 = 1e-3;

/// What a surface is made of. Seen from both sides alike, but for glass, unless its [`Cover`] says otherwise.
///
/// Microfacets are GGX with Smith's height-correlated masking, single scattering (Walter et al. 2007; Heitz 2014, 2018).
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
        /// Index of refraction of the side the normal points away from, over that of the other: 0.25…4.
        ior: f32,
        /// Factor on refracted light at each crossing, 0…1.
        tint: Rgb,
    },
    /// A thin pane: both boundaries at once, all reflections between them summed, and light goes straight through.
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
    /// A conductor with its complex index of refraction η + ik, each 0…100, by channel.
    Conductor {
        /// Real part.
        eta: Rgb,
        /// Imaginary part.
        k: Rgb,
        /// Factor on the reflection, 0…1.
        reflectance: Texture,
        /// GGX α, 0…1; below [`MIN_ROUGHNESS`] the surface is a mirror.
        roughness: f32,
    },
    /// A dielectric coat on a Lambertian base. The light that comes out of the base is what the coat let in, reflected
    /// between base and coat any number of times, as in Mitsuba's `plastic` and `roughplastic` (Jakob 2010). As there, a rough
    /// coat loses the light that its facets mask inside: a white base under α = 0.2 gives back four fifths.
    Plastic {
        /// Albedo of the base, 0…1.
        diffuse: Texture,
        /// Factor on the coat's reflection, 0…1.
        specular: Rgb,
        /// Index of refraction of the coat, above 1 and up to 4.
        ior: f32,
        /// GGX α of the coat, 0…1; below [`MIN_ROUGHNESS`] it is smooth.
        roughness: f32,
        /// Whether light takes on the base's colour at each reflection between base and coat, or once.
        nonlinear: bool,
    },
    /// glTF's metal and roughness: a blend of a nonlinear [`Material::Plastic`], without that loss, and a
    /// [`Material::RoughConductor`] of the same colour.
    MetallicRoughness {
        /// Albedo of the dielectric and reflectance of the metal, 0…1.
        base: Texture,
        /// Green: the square root of GGX's α; blue: the share of metal; red is not used.
        metallic_roughness: Texture,
        /// Index of refraction of the dielectric, above 1 and up to 4; glTF's default is 1.5.
        ior: f32,
    },
}

/// What a surface lets through or hides besides its material.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cover {
    /// Where the surface is: the mean of the channels is the probability that a ray meets it; else the ray goes straight on.
    pub opacity: Option<Texture>,
    /// Whether the back swallows all light.
    pub one_sided: bool,
}

/// What a scene's surfaces look like, apart from their shapes.
#[derive(Clone, Debug)]
pub(crate) struct Looks {
    pub(crate) kind: Kind,
    pub(crate) opacity: Option<Texture>,
    pub(crate) one_sided: bool,
}

/// A colour, looked up only where it varies.
#[derive(Clone, Debug)]
pub(crate) enum Paint {
    Plain(Vec3),
    Varied(Box<Texture>),
}

/// Materials as the inner loop has them.
#[derive(Clone, Debug)]
pub(crate) enum Kind {
    Diffuse { albedo: Paint },
    Mirror { fresnel: Fresnel, colour: Paint },
    Glass { ior: f32, tint: Vec3 },
    ThinGlass { ior: f32, tint: Vec3 },
    Metal { fresnel: Fresnel, colour: Paint, alpha: f32 },
    Plastic { diffuse: Paint, specular: Vec3, alpha: f32, nonlinear: bool, coat: Arc<Coat> },
    Blend { base: Paint, metallic_roughness: Paint, coat: Arc<Coat> },
}

impl Paint {
    fn new(texture: Texture) -> Self {
        match texture.constant() {
            Some(colour) => Self::Plain(colour),
            None => Self::Varied(Box::new(texture)),
        }
    }

    fn varies(&self) -> bool {
        matches!(self, Self::Varied(_))
    }

    /// The colour at `uv`. `TEXTURES` says whether the scene has any.
    #[inline]
    pub(crate) fn at<const TEXTURES: bool>(&self, uv: [f32; 2]) -> Vec3 {
        match self {
            Self::Plain(colour) => *colour,
            Self::Varied(texture) if TEXTURES => texture.eval(uv[0], uv[1]),
            Self::Varied(_) => Vec3::ZERO,
        }
    }
}

fn range(what: &'static str, value: f32, low: f32, high: f32, range: &'static str) -> Result<(), SceneError> {
    // `contains` is false for NaN too
    if (low..=high).contains(&value) { Ok(()) } else { Err(SceneError::Range { what, value, range }) }
}

impl Material {
    /// A diffuse material of one colour.
    pub fn diffuse(albedo: Rgb) -> Self {
        Material::Diffuse { albedo: albedo.into() }
    }

    fn check(&self) -> Result<(), SceneError> {
        let rough = |value: &f32| range("a roughness", *value, 0.0, 1.0, "0…1");
        let coat = |value: &f32| range("an index of refraction", *value, 1.0001, 4.0, "1…4, 1 excluded");
        match self {
            Material::Diffuse { albedo } => albedo.check(),
            Material::Mirror { reflectance } => check_reflectance(*reflectance),
            Material::Glass { ior, tint } | Material::ThinGlass { ior, tint } => {
                range("an index of refraction", *ior, 0.25, 4.0, "0.25…4")?;
                check_reflectance(*tint)
            }
            Material::RoughConductor { reflectance, roughness } => {
                rough(roughness)?;
                reflectance.check()
            }
            Material::Conductor { eta, k, reflectance, roughness } => {
                for value in eta.iter().chain(k) {
                    range("an index of refraction", *value, 0.0, 100.0, "0…100")?;
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
                coat(ior)?;
                metallic_roughness.check()?;
                base.check()
            }
        }
    }
}

impl Looks {
    /// Checks a material and its cover, and makes them ready for the inner loop.
    /// Coats that are alike are shared: they are tables.
    pub(crate) fn new(
        material: Material,
        cover: Cover,
        coats: &mut Vec<Arc<Coat>>,
    ) -> Result<Self, SceneError> {
        material.check()?;
        cover.opacity.as_ref().map_or(Ok(()), Texture::check)?;
        let metal = |fresnel, colour, alpha: f32| {
            if alpha < MIN_ROUGHNESS {
                Kind::Mirror { fresnel, colour }
            } else {
                Kind::Metal { fresnel, colour, alpha }
            }
        };
        let mut coat = |ior, alpha, inside| match coats.iter().find(|c| c.is_for(ior, alpha, inside)) {
            Some(coat) => coat.clone(),
            None => {
                coats.push(Arc::new(Coat::new(ior, alpha, inside)));
                coats[coats.len() - 1].clone()
            }
        };
        // A smooth coat masks nothing
        let inside = |alpha: f32| if alpha < MIN_ROUGHNESS { Inside::Kept } else { Inside::Once };
        let kind = match material {
            Material::Diffuse { albedo } => Kind::Diffuse { albedo: Paint::new(albedo) },
            Material::Mirror { reflectance } => {
                Kind::Mirror { fresnel: Fresnel::None, colour: Paint::Plain(reflectance.into()) }
            }
            Material::Glass { ior, tint } => Kind::Glass { ior, tint: tint.into() },
            Material::ThinGlass { ior, tint } => Kind::ThinGlass { ior, tint: tint.into() },
            Material::RoughConductor { reflectance, roughness } => {
                metal(Fresnel::Schlick, Paint::new(reflectance), roughness)
            }
            Material::Conductor { eta, k, reflectance, roughness } => {
                let fresnel = Fresnel::Complex { eta: eta.into(), k: k.into() };
                metal(fresnel, Paint::new(reflectance), roughness)
            }
            Material::Plastic { diffuse, specular, ior, roughness, nonlinear } => Kind::Plastic {
                diffuse: Paint::new(diffuse),
                specular: specular.into(),
                alpha: roughness,
                nonlinear,
                coat: coat(ior, Some(roughness), inside(roughness)),
            },
            Material::MetallicRoughness { base, metallic_roughness, ior } => {
                let fixed = metallic_roughness.constant().map(|c| (c.y * c.y).max(MIN_ROUGHNESS));
                Kind::Blend {
                    base: Paint::new(base),
                    metallic_roughness: Paint::new(metallic_roughness),
                    coat: coat(ior, fixed, Inside::Kept),
                }
            }
        };
        // A surface that is everywhere has no holes
        let opacity = cover.opacity.filter(|o| o.constant() != Some(Vec3::ONE));
        Ok(Self { kind, opacity, one_sided: cover.one_sided })
    }

    /// Whether texture coordinates matter.
    pub(crate) fn is_textured(&self) -> bool {
        self.is_coloured() || self.opacity.as_ref().is_some_and(|o| o.constant().is_none())
    }

    /// Whether the material, apart from its cover, has a texture.
    pub(crate) fn is_coloured(&self) -> bool {
        match &self.kind {
            Kind::Diffuse { albedo: p } | Kind::Mirror { colour: p, .. } | Kind::Metal { colour: p, .. } => {
                p.varies()
            }
            Kind::Plastic { diffuse, .. } => diffuse.varies(),
            Kind::Blend { base, metallic_roughness, .. } => base.varies() || metallic_roughness.varies(),
            Kind::Glass { .. } | Kind::ThinGlass { .. } => false,
        }
    }

    /// Whether it scatters by microfacets or a coat.
    pub(crate) fn is_glossy(&self) -> bool {
        matches!(self.kind, Kind::Metal { .. } | Kind::Plastic { .. } | Kind::Blend { .. })
    }

    /// Whether it is a mirror or glass.
    pub(crate) fn is_specular(&self) -> bool {
        matches!(self.kind, Kind::Mirror { .. } | Kind::Glass { .. } | Kind::ThinGlass { .. })
    }
}
