//! Materials, as described by the caller and as used in the inner loop.

use crate::bsdf::{Coat, Facets, Fresnel, Ggx, Interior, MIN_ROUGHNESS, OrenNayar};
use crate::checks::{check_range, check_reflectance};
use crate::error::SceneError;
use crate::math::Vec3;
use crate::relief::Relief;
use crate::texture::Texture;
use noisefloor::Rgb;
use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;

/// What a surface is made of. Except for glass, both sides look the same, unless [`MaterialOptions`] says
/// otherwise.
///
/// Microfacets are GGX with Smith's height-correlated masking, single scattering (Walter et al. 2007; Heitz
/// 2014, 2018), unless [`MaterialOptions::facets`] says otherwise.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Material {
    /// Lambertian reflection.
    Diffuse {
        /// Reflectance, 0…1.
        albedo: Texture,
    },
    /// A perfect mirror.
    Mirror {
        /// Reflectance at all angles, 0…1.
        reflectance: Rgb,
    },
    /// A smooth dielectric boundary: unpolarised Fresnel reflection and refraction.
    ///
    /// Paths carry basic radiance L/η², which is exact as long as the camera and all emitters lie outside the
    /// glass.
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
        /// Real part.
        eta: Rgb,
        /// Imaginary part.
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
    /// glTF's metallic-roughness model: a blend of a nonlinear [`Material::Plastic`] without that loss and a
    /// [`Material::RoughConductor`] of the same colour.
    MetallicRoughness {
        /// Albedo of the dielectric and reflectance of the metal, 0…1.
        base: Texture,
        /// Green: the square root of GGX's α. Blue: the share of metal. Red is not used.
        metallic_roughness: Texture,
        /// Index of refraction of the dielectric, above 1 and up to 4; glTF's default is 1.5.
        ior: f32,
    },
    /// Lobes that add up.
    Lobes(Box<Lobes>),
}

/// A sum of diffuse reflection, diffuse transmission and microfacets, as the `matte`, `plastic`, `uber`,
/// `substrate` and `translucent` of pbrt's version 3 and the `diffusetransmission` of version 4 (Pharr, Jakob,
/// Humphreys 2016, §8.4 and §9.2). The facets of a [`Gloss::Dielectric`] take nothing from the rest: the sum can
/// be more light than comes. All black by default.
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
    /// How the facets reflect.
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
        /// Index of refraction of what lies below, over that above: 0.25…4. Below 1, light that comes flatly is
        /// reflected totally.
        ior: f32,
    },
    /// By Schlick's term and without masking; the diffuse reflection gets what they leave (Ashikhmin, Shirley
    /// 2000, with GGX).
    AshikhminShirley,
}

/// Opacity and sidedness of a surface, besides its [`Material`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialOptions {
    /// The mean of the channels is the probability that the surface stops a ray; other rays pass straight
    /// through. `None`: opaque everywhere.
    pub opacity: Option<Texture>,
    /// Whether the back absorbs all light.
    pub one_sided: bool,
    /// The microfacets of [`Material::RoughConductor`], [`Material::Conductor`], [`Material::Plastic`],
    /// [`Material::RoughGlass`] and [`Material::Lobes`].
    pub facets: Facets,
    /// Structure of the surface. That of a mix is also that of its parts that have none.
    pub relief: Option<Relief>,
}

/// A material and its options, prepared for the inner loop.
#[derive(Clone, Debug)]
pub(crate) struct CompiledMaterial {
    pub(crate) bsdf: Bsdf,
    pub(crate) opacity: Option<Texture>,
    pub(crate) one_sided: bool,
    pub(crate) relief: Option<Box<Relief>>,
}

/// A colour, looked up only if it varies.
#[derive(Clone, Debug)]
pub(crate) enum Reflectance {
    Constant(Vec3),
    Textured(Box<Texture>),
    /// Times the colours of corners.
    Corners(Option<Box<Texture>>),
}

/// How a surface scatters light.
#[derive(Clone, Debug)]
pub(crate) enum Bsdf {
    Diffuse {
        albedo: Reflectance,
    },
    Mirror {
        fresnel: Fresnel,
        colour: Reflectance,
    },
    Glass {
        ior: f32,
        tint: Vec3,
    },
    ThinGlass {
        ior: f32,
        tint: Vec3,
    },
    RoughGlass {
        ior: f32,
        tint: Vec3,
        ggx: Ggx,
    },
    Metal {
        fresnel: Fresnel,
        colour: Reflectance,
        ggx: Ggx,
    },
    Plastic {
        diffuse: Reflectance,
        specular: Vec3,
        ggx: Ggx,
        nonlinear: bool,
        coat: Arc<Coat>,
    },
    Blend {
        base: Reflectance,
        metallic_roughness: Reflectance,
        coat: Arc<Coat>,
    },
    Lobes {
        diffuse: Reflectance,
        through: Reflectance,
        specular: Reflectance,
        mirror: Reflectance,
        gloss: Gloss,
        oren_nayar: OrenNayar,
        ggx: Ggx,
    },
    /// `share` of the second material, and the rest of the first, by their indices. The share of a `coat` is
    /// multiplied with what a smooth boundary reflects.
    Mix {
        parts: [u32; 2],
        share: Reflectance,
        coat: bool,
    },
}

impl Bsdf {
    /// What colour a denoiser should take the surface for: of diffuse and metallic parts their albedo, of glass
    /// its tint.
    pub(crate) fn colour(&self, uv: [f32; 2], tint: Vec3) -> Vec3 {
        match self {
            Self::Diffuse { albedo: colour }
            | Self::Mirror { colour, .. }
            | Self::Metal { colour, .. }
            | Self::Plastic { diffuse: colour, .. }
            | Self::Lobes { diffuse: colour, .. }
            | Self::Blend { base: colour, .. } => colour.tinted(uv, tint),
            Self::Glass { tint, .. } | Self::ThinGlass { tint, .. } | Self::RoughGlass { tint, .. } => *tint,
            // Intersections have one of its parts
            Self::Mix { .. } => Vec3::ZERO,
        }
    }
}

impl Reflectance {
    pub(crate) fn new(texture: Texture) -> Self {
        match (texture.constant(), texture) {
            (Some(colour), _) => Self::Constant(colour),
            (None, Texture::Corners(texture)) => Self::Corners(texture),
            (None, texture) => Self::Textured(Box::new(texture)),
        }
    }

    fn varies(&self) -> bool {
        !matches!(self, Self::Constant(_) | Self::Corners(None))
    }

    /// The colour at `uv`, where that of the corners does not count.
    #[inline]
    pub(crate) fn at(&self, uv: [f32; 2]) -> Vec3 {
        self.tinted(uv, Vec3::ONE)
    }

    /// The colour at `uv`, between corners of the colour `tint`.
    #[inline]
    pub(crate) fn tinted(&self, uv: [f32; 2], tint: Vec3) -> Vec3 {
        match self {
            Self::Constant(colour) => *colour,
            Self::Textured(texture) => texture.eval(uv[0], uv[1]),
            Self::Corners(None) => tint,
            Self::Corners(Some(texture)) => tint * texture.eval(uv[0], uv[1]),
        }
    }
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
                coat(ior)?;
                metallic_roughness.check()?;
                base.check()
            }
            Material::Lobes(lobes) => {
                let Lobes { diffuse, through, specular, mirror, gloss, sigma, roughness } = lobes.as_ref();
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
    }
}

impl MaterialOptions {
    fn check(&self) -> Result<(), SceneError> {
        self.opacity.as_ref().map_or(Ok(()), Texture::check)?;
        self.relief.as_ref().map_or(Ok(()), Relief::check)
    }
}

impl CompiledMaterial {
    /// Checks a material and its options, and prepares them for the inner loop. Equal coats are shared, since
    /// they are tables.
    pub(crate) fn new(
        material: Material,
        options: MaterialOptions,
        coats: &mut Vec<Arc<Coat>>,
    ) -> Result<Self, SceneError> {
        material.check()?;
        options.check()?;
        let metal = |fresnel, colour, alpha| metal(fresnel, colour, alpha, options.facets);
        let mut coat = |ior, alpha, facets, inside| Coat::shared(coats, ior, alpha, facets, inside);
        // A smooth coat masks nothing
        let inside = |alpha: f32| {
            if alpha < MIN_ROUGHNESS { Interior::Conserving } else { Interior::SingleScattering }
        };
        let bsdf = match material {
            Material::Diffuse { albedo } => Bsdf::Diffuse { albedo: Reflectance::new(albedo) },
            Material::Mirror { reflectance } => {
                Bsdf::Mirror { fresnel: Fresnel::None, colour: Reflectance::Constant(reflectance.into()) }
            }
            Material::Glass { ior, tint } => Bsdf::Glass { ior, tint: tint.into() },
            Material::ThinGlass { ior, tint } => Bsdf::ThinGlass { ior, tint: tint.into() },
            Material::RoughGlass { ior, tint, roughness } if roughness < MIN_ROUGHNESS => {
                Bsdf::Glass { ior, tint: tint.into() }
            }
            Material::RoughGlass { ior, tint, roughness } => {
                let ggx = Ggx::of(roughness, options.facets.uncorrelated());
                Bsdf::RoughGlass { ior, tint: tint.into(), ggx }
            }
            Material::RoughConductor { reflectance, roughness } => {
                metal(Fresnel::Schlick, Reflectance::new(reflectance), roughness)
            }
            Material::Conductor { eta, k, reflectance, roughness } => {
                let fresnel = Fresnel::Complex { eta: eta.into(), k: k.into() };
                metal(fresnel, Reflectance::new(reflectance), roughness)
            }
            Material::Plastic { diffuse, specular, ior, roughness, nonlinear } => Bsdf::Plastic {
                diffuse: Reflectance::new(diffuse),
                specular: specular.into(),
                ggx: Ggx::of(roughness, options.facets),
                nonlinear,
                coat: coat(ior, Some(roughness), options.facets, inside(roughness)),
            },
            Material::MetallicRoughness { base, metallic_roughness, ior } => {
                let fixed = metallic_roughness.constant().map(|c| (c.y * c.y).max(MIN_ROUGHNESS));
                Bsdf::Blend {
                    base: Reflectance::new(base),
                    metallic_roughness: Reflectance::new(metallic_roughness),
                    coat: coat(ior, fixed, Facets::Ggx, Interior::Conserving),
                }
            }
            Material::Lobes(lobes) => {
                let Lobes { diffuse, through, specular, mirror, gloss, sigma, roughness } = *lobes;
                Bsdf::Lobes {
                    diffuse: Reflectance::new(diffuse),
                    through: Reflectance::new(through),
                    specular: Reflectance::new(specular),
                    mirror: Reflectance::new(mirror),
                    gloss,
                    oren_nayar: OrenNayar::new(sigma),
                    ggx: Ggx::of(roughness, options.facets),
                }
            }
        };
        Ok(Self::with(bsdf, options))
    }

    /// A mix of two materials that exist already.
    pub(crate) fn mix(
        parts: [u32; 2],
        share: Texture,
        coat: bool,
        options: MaterialOptions,
    ) -> Result<Self, SceneError> {
        share.check()?;
        options.check()?;
        let bsdf = Bsdf::Mix { parts, share: Reflectance::new(share), coat };
        Ok(Self::with(bsdf, options))
    }

    fn with(bsdf: Bsdf, MaterialOptions { opacity, one_sided, relief, .. }: MaterialOptions) -> Self {
        // An opacity of one everywhere is none
        let opacity = opacity.filter(|o| o.constant() != Some(Vec3::ONE));
        Self { bsdf, opacity, one_sided, relief: relief.map(Box::new) }
    }

    /// Whether it has a texture.
    pub(crate) fn is_textured(&self) -> bool {
        let colours = match &self.bsdf {
            Bsdf::Diffuse { albedo: c } | Bsdf::Mirror { colour: c, .. } | Bsdf::Metal { colour: c, .. } => {
                c.varies()
            }
            Bsdf::Plastic { diffuse, .. } => diffuse.varies(),
            Bsdf::Lobes { diffuse, through, specular, mirror, .. } => {
                [diffuse, through, specular, mirror].into_iter().any(Reflectance::varies)
            }
            Bsdf::Blend { base, metallic_roughness, .. } => base.varies() || metallic_roughness.varies(),
            Bsdf::Glass { .. } | Bsdf::ThinGlass { .. } | Bsdf::RoughGlass { .. } => false,
            // Its parts may have one
            Bsdf::Mix { .. } => true,
        };
        colours || self.relief.is_some() || self.opacity.as_ref().is_some_and(|o| o.constant().is_none())
    }
}

/// A metal, which is a mirror if it is smooth.
fn metal(fresnel: Fresnel, colour: Reflectance, alpha: f32, facets: Facets) -> Bsdf {
    if alpha < MIN_ROUGHNESS {
        Bsdf::Mirror { fresnel, colour }
    } else {
        Bsdf::Metal { fresnel, colour, ggx: Ggx::of(alpha, facets) }
    }
}
