//! Materials as used in the inner loop.

use super::{Gloss, Lobes, Material, MaterialOptions, Principled};
use crate::bsdf::{Coat, Facets, Fresnel, Ggx, Interior, MIN_ROUGHNESS, OrenNayar};
use crate::error::SceneError;
use crate::math::Vec3;
use crate::relief::Relief;
use crate::texture::{Coordinates, Texture};
use std::sync::Arc;

/// A material and its options, prepared for the inner loop.
#[derive(Clone, Debug)]
pub(crate) struct CompiledMaterial {
    pub(crate) bsdf: Bsdf,
    pub(crate) opacity: Option<Texture>,
    pub(crate) cutoff: Option<f32>,
    pub(crate) one_sided: bool,
    pub(crate) culled: bool,
    /// α along and across growing u.
    pub(crate) alphas: Option<Box<Texture>>,
    /// Whether scattering depends on how the surface runs along its texture coordinates.
    pub(crate) directional: bool,
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
    Gltf {
        base: Reflectance,
        metallic_roughness: Reflectance,
        /// Reflectance of the dielectric at normal incidence.
        f0: f32,
    },
    Principled {
        base: Reflectance,
        metallic_roughness: Reflectance,
        /// The rest of it; its textures are not used.
        more: Box<Principled>,
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
    Nothing,
    /// `share` of the second material, and the rest of the first, by their indices. The share of a `coat` is
    /// multiplied with what a smooth boundary reflects.
    Mix {
        parts: [u32; 2],
        share: Reflectance,
        coat: bool,
    },
}

impl Bsdf {
    /// What colour a denoiser should take the surface for: of diffuse and metallic parts their albedo, of
    /// glass its tint.
    pub(crate) fn colour(&self, uv: Coordinates, tint: Vec3) -> Vec3 {
        match self {
            Self::Diffuse { albedo: colour }
            | Self::Mirror { colour, .. }
            | Self::Metal { colour, .. }
            | Self::Plastic { diffuse: colour, .. }
            | Self::Lobes { diffuse: colour, .. }
            | Self::Gltf { base: colour, .. }
            | Self::Principled { base: colour, .. } => colour.tinted(uv, tint),
            Self::Glass { tint, .. } | Self::ThinGlass { tint, .. } | Self::RoughGlass { tint, .. } => *tint,
            // Intersections have one of its parts
            Self::Nothing | Self::Mix { .. } => Vec3::ZERO,
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
    pub(crate) fn at(&self, uv: Coordinates) -> Vec3 {
        self.tinted(uv, Vec3::ONE)
    }

    /// The colour at `uv`, between corners of the colour `tint`.
    #[inline]
    pub(crate) fn tinted(&self, uv: Coordinates, tint: Vec3) -> Vec3 {
        match self {
            Self::Constant(colour) => *colour,
            Self::Textured(texture) => texture.eval(uv),
            Self::Corners(None) => tint,
            Self::Corners(Some(texture)) => tint * texture.eval(uv),
        }
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
        let given = options.roughness.is_some();
        let rough = |alpha: f32| if given { alpha.max(MIN_ROUGHNESS) } else { alpha };
        let metal = |fresnel, colour, alpha| metal(fresnel, colour, rough(alpha), options.facets);
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
            Material::RoughGlass { ior, tint, roughness } if rough(roughness) < MIN_ROUGHNESS => {
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
                ggx: Ggx::of(rough(roughness), options.facets),
                nonlinear,
                coat: coat(ior, (!given).then_some(roughness), options.facets, inside(rough(roughness))),
            },
            Material::MetallicRoughness { base, metallic_roughness, ior } => Bsdf::Gltf {
                base: Reflectance::new(base),
                metallic_roughness: Reflectance::new(metallic_roughness),
                f0: ((ior - 1.0) / (ior + 1.0)).powi(2),
            },
            Material::Principled(principled) => {
                let Principled { base, metallic_roughness, .. } = *principled.clone();
                Bsdf::Principled {
                    base: Reflectance::new(base),
                    metallic_roughness: Reflectance::new(metallic_roughness),
                    more: principled,
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
            Material::Nothing => Bsdf::Nothing,
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

    fn with(bsdf: Bsdf, options: MaterialOptions) -> Self {
        let MaterialOptions { opacity, cutoff, one_sided, culled, roughness, relief, .. } = options;
        // An opacity of one everywhere is none
        let opacity = opacity.filter(|o| o.constant() != Some(Vec3::ONE));
        let directional = match &bsdf {
            Bsdf::Principled { more, .. } => more.anisotropic > 0.0,
            _ => roughness.is_some(),
        };
        let (alphas, relief) = (roughness.map(Box::new), relief.map(Box::new));
        Self { bsdf, opacity, cutoff, one_sided, culled, alphas, directional, relief }
    }

    /// Whether rays may pass it.
    pub(crate) fn lets_pass(&self) -> bool {
        self.culled || self.opacity.is_some() || self.is_nothing()
    }

    /// Whether it stops no light.
    #[inline]
    pub(crate) fn is_nothing(&self) -> bool {
        matches!(self.bsdf, Bsdf::Nothing)
    }

    /// The microfacets at `uv`, which are `own` unless α varies.
    #[inline]
    pub(crate) fn facets(&self, own: Ggx, uv: Coordinates) -> Ggx {
        match &self.alphas {
            None => own,
            Some(alphas) => {
                let c = alphas.eval(uv).max(Vec3::splat(MIN_ROUGHNESS));
                own.stretched([c.x, c.y])
            }
        }
    }

    /// Whether it has a texture, or runs along texture coordinates.
    pub(crate) fn is_textured(&self) -> bool {
        let colours = match &self.bsdf {
            Bsdf::Diffuse { albedo: c } | Bsdf::Mirror { colour: c, .. } | Bsdf::Metal { colour: c, .. } => {
                c.varies()
            }
            Bsdf::Plastic { diffuse, .. } => diffuse.varies(),
            Bsdf::Lobes { diffuse, through, specular, mirror, .. } => {
                [diffuse, through, specular, mirror].into_iter().any(Reflectance::varies)
            }
            Bsdf::Gltf { base, metallic_roughness, .. }
            | Bsdf::Principled { base, metallic_roughness, .. } => {
                base.varies() || metallic_roughness.varies()
            }
            Bsdf::Glass { .. } | Bsdf::ThinGlass { .. } | Bsdf::RoughGlass { .. } | Bsdf::Nothing => false,
            // Its parts may have one
            Bsdf::Mix { .. } => true,
        };
        colours
            || self.directional
            || self.relief.is_some()
            || self.opacity.as_ref().is_some_and(|o| o.constant().is_none())
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
