//! Parts of a scene that several readers share.

use noisefloor_ptwne::{Facets, Material, Relief, Texture};

/// A material, or a blend of two surfaces, and what it lets through.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    pub(super) body: Body,
    /// Where the surface is; everywhere if there is none.
    pub(super) opacity: Option<Texture>,
    /// Whether it is black from behind.
    pub(super) one_sided: bool,
    pub(super) facets: Facets,
    /// α of its microfacets along and across u, instead of the material's number.
    pub(super) alphas: Option<Texture>,
    /// Its bumps, and of a blend those of its parts that have none.
    pub(super) relief: Option<Relief>,
}

#[derive(Clone, Debug)]
pub(super) enum Body {
    Plain(Material),
    /// The first of them, but for the share of the second.
    Blend(Box<[Surface; 2]>, Texture),
}

impl Surface {
    /// What reflects, and is black from behind.
    pub(super) fn one_sided(material: Material) -> Self {
        let (body, facets) = (Body::Plain(material), Facets::GgxUncorrelated);
        Self { body, opacity: None, one_sided: true, facets, alphas: None, relief: None }
    }

    /// What is seen from both sides.
    pub(super) fn two_sided(material: Material) -> Self {
        Self { one_sided: false, ..Self::one_sided(material) }
    }

    /// `share` of the second surface, and the rest of the first.
    pub(super) fn blend(first: Self, second: Self, share: Texture) -> Self {
        let one_sided = first.one_sided && second.one_sided;
        let body = Body::Blend(Box::new([first, second]), share);
        Self { body, opacity: None, one_sided, facets: Facets::default(), alphas: None, relief: None }
    }

    /// How many surfaces it is mixed of.
    pub(super) fn parts(&self) -> usize {
        match &self.body {
            Body::Plain(_) => 1,
            Body::Blend(parts, _) => parts.iter().map(Self::parts).sum(),
        }
    }

    /// What Mitsuba gives shapes without a surface: grey, or, if they shine, black.
    pub(super) fn missing(shines: bool) -> Self {
        Self::one_sided(Material::diffuse([if shines { 0.0 } else { 0.5 }; 3]))
    }

    /// What lets all light through.
    pub(super) fn nothing() -> Self {
        let opacity = Some(Texture::Colour([0.0; 3]));
        Self { opacity, ..Self::two_sided(Material::diffuse([0.0; 3])) }
    }

    /// The same from both sides.
    pub(super) fn seen_from_both_sides(mut self) -> Self {
        self.one_sided = false;
        if let Body::Blend(parts, _) = &mut self.body {
            **parts = (**parts).clone().map(Self::seen_from_both_sides);
        }
        self
    }

    /// The surface that looks from its front as this one does from its back.
    pub(super) fn inside_out(mut self) -> Self {
        match &mut self.body {
            Body::Plain(Material::Glass { ior, .. } | Material::RoughGlass { ior, .. }) => *ior = ior.recip(),
            Body::Plain(_) => {}
            Body::Blend(parts, _) => **parts = (**parts).clone().map(Self::inside_out),
        }
        self
    }

    /// Whether it has a texture, or runs along texture coordinates.
    pub(super) fn is_textured(&self) -> bool {
        let varies = |texture: &Texture| !matches!(texture, Texture::Colour(_));
        self.relief.is_some()
            || self.alphas.is_some()
            || self.opacity.as_ref().is_some_and(varies)
            || match &self.body {
                Body::Blend(parts, share) => varies(share) || parts.iter().any(Self::is_textured),
                Body::Plain(material) => match material {
                    Material::Diffuse { albedo: texture }
                    | Material::Plastic { diffuse: texture, .. }
                    | Material::RoughConductor { reflectance: texture, .. }
                    | Material::Conductor { reflectance: texture, .. } => varies(texture),
                    Material::Lobes(lobes) => varies(&lobes.diffuse),
                    Material::Principled(surface) => {
                        varies(&surface.base)
                            || varies(&surface.metallic_roughness)
                            || surface.anisotropic > 0.0
                    }
                    _ => false,
                },
            }
    }
}

/// An attribute that a surface takes its colour from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Attribute {
    /// With `vertex_` or `face_` in front.
    pub(super) name: String,
    pub(super) scale: f64,
}
