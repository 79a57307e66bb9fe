//! Surfaces: Mitsuba's `bsdf` elements.

use super::context::Context;
use super::surface::{Body, Surface};
use super::textures::peak;
use super::xml::Element;
use crate::colour::Quantity;
use crate::error::LoadError;
use noisefloor::Rgb;
use noisefloor_ptwne::{Facets, Lobes, Material, Relief, Texture};
use std::f32::consts::FRAC_1_SQRT_2;

/// Most surfaces that one mixes, whatever they are mixed of.
const MAX_MIXED: u64 = 256;

impl<'d> Context<'d> {
    /// A `bsdf`.
    ///
    /// # Errors
    /// [`LoadError`] if it is broken, of a kind that is not supported, or in itself.
    pub(super) fn surface(&self, element: &'d Element) -> Result<Surface, LoadError> {
        let serial = element.serial;
        if let Some(known) = self.surfaces.borrow().get(&serial) {
            self.spend(element, known.parts())?;
            return Ok(known.clone());
        }
        let surface = self.nested_in(element, || self.of_kind(element))?;
        self.surfaces.borrow_mut().insert(serial, surface.clone());
        Ok(surface)
    }

    /// `share` of the second surface, and the rest of the first.
    fn blended(
        &self,
        element: &Element,
        first: Surface,
        second: Surface,
        share: Texture,
    ) -> Result<Surface, LoadError> {
        let parts = first.parts() + second.parts();
        self.spend(element, parts)?;
        self.place(element).at_most("surfaces that are mixed", parts as u64, MAX_MIXED)?;
        Ok(Surface::blend(first, second, share))
    }

    fn of_kind(&self, element: &'d Element) -> Result<Surface, LoadError> {
        match element.kind() {
            "diffuse" | "roughdiffuse" => self.diffuse(element),
            "plastic" | "roughplastic" | "pplastic" => {
                let facets = self.facets(element)?;
                Ok(Surface { facets, ..Surface::one_sided(self.plastic(element)?) })
            }
            "conductor" | "roughconductor" => self.conductor(element),
            "dielectric" | "thindielectric" | "roughdielectric" => self.glass(element),
            "phong" | "ward" => self.lobe_on_diffuse(element),
            "principled" | "principledthin" => self.principled(element),
            "null" => Ok(Surface::nothing()),
            "twosided" => self.twosided(element),
            "mask" => self.mask(element),
            "blendbsdf" => self.blend(element),
            "mixturebsdf" => self.mixture(element),
            "coating" | "roughcoating" => self.coating(element),
            "bumpmap" | "bump" | "normalmap" | "normal" => self.relief(element),
            _ => Err(self.unsupported_kind(element)),
        }
    }

    /// The one surface in another.
    fn nested(&self, element: &'d Element) -> Result<&'d Element, LoadError> {
        let parts = self.parts(element, "bsdf")?;
        match parts.as_slice() {
            [one] => Ok(one),
            [] => Err(self.bad(element, format!("{} needs a <bsdf> in it", element.label()))),
            _ => {
                Err(self
                    .unsupported(element, format!("{} with more than one <bsdf> in it", element.species())))
            }
        }
    }

    fn diffuse(&self, element: &'d Element) -> Result<Surface, LoadError> {
        // Older versions have another name for it, too
        let old = element.has("diffuse_reflectance");
        let name = if old { "diffuse_reflectance" } else { "reflectance" };
        let diffuse = self.factor(element, name, 0.5)?;
        if element.kind() == "diffuse" {
            return Ok(Surface::one_sided(Material::Diffuse { albedo: diffuse }));
        }
        if !self.boolean(element, "use_fast_approx", false)? {
            self.approximated(element, "<bsdf type=\"roughdiffuse\"> is replaced by its fast approximation");
        }
        // Its α is that of Beckmann's slopes (Mitsuba 0.6)
        let alpha = self.mean_float(element, "alpha")?.unwrap_or(0.2).clamp(0.0, 1.0);
        let sigma = alpha as f32 * FRAC_1_SQRT_2;
        Ok(Surface::one_sided(Lobes { diffuse, sigma, ..Lobes::default() }.into()))
    }

    fn twosided(&self, element: &'d Element) -> Result<Surface, LoadError> {
        let parts = self.parts(element, "bsdf")?;
        let front = match parts.as_slice() {
            [front, _] => {
                self.approximated(element, "the back of <bsdf type=\"twosided\"> looks as its front does");
                front
            }
            _ => self.nested(element)?,
        };
        Ok(self.surface(front)?.seen_from_both_sides())
    }

    fn mask(&self, element: &'d Element) -> Result<Surface, LoadError> {
        let surface = self.surface(self.nested(element)?)?;
        if surface.opacity.is_some() {
            return Err(self.unsupported(element, "a mask in a mask"));
        }
        let opacity = self.varying(element, self.factor(element, "opacity", 0.5)?)?;
        let opacity = self.one_channel(element, opacity)?;
        Ok(Surface { opacity: Some(opacity), ..surface })
    }

    fn blend(&self, element: &'d Element) -> Result<Surface, LoadError> {
        let parts = self.parts(element, "bsdf")?;
        let [first, second] = parts.as_slice() else {
            return Err(self.bad(element, format!("{} needs two <bsdf> in it", element.label())));
        };
        let share = self.one_channel(element, self.factor(element, "weight", 0.5)?)?;
        self.blended(element, self.surface(first)?, self.surface(second)?, share)
    }

    /// Bumps on a surface: by heights or by normals.
    fn relief(&self, element: &'d Element) -> Result<Surface, LoadError> {
        element.ignore(&["flip_invalid_normals", "use_shadowing_function"]);
        let surface = self.surface(self.nested(element)?)?;
        if surface.relief.is_some() {
            return Err(self.unsupported(element, "relief on relief"));
        }
        let textures = self.parts(element, "texture")?;
        let [texture] = textures.as_slice() else {
            return Err(self.bad(element, format!("{} needs one <texture> in it", element.label())));
        };
        let relief = if element.kind().starts_with("bump") {
            let scale = self.float(element, "scale")?.unwrap_or(1.0) as f32;
            let (peak, map) = self.image(texture, Quantity::Light)?;
            Relief::Heights { map: self.varying(texture, map)?, scale: scale * peak }
        } else {
            let map = self.varying(texture, self.image(texture, Quantity::Factor)?.1)?;
            Relief::Normals { map, scale: 1.0, mirrors: false }
        };
        Ok(Surface { relief: Some(relief), ..surface })
    }

    /// Any number of surfaces by their `weights`, of Mitsuba 0.6. What the weights lack to 1 is absorbed.
    fn mixture(&self, element: &'d Element) -> Result<Surface, LoadError> {
        let parts = self.parts(element, "bsdf")?;
        let weights = self.numbers(element, self.string(element, "weights")?.unwrap_or_default())?;
        if weights.len() != parts.len() || weights.iter().any(|w| *w < 0.0) {
            return Err(self.bad(element, "a mixture needs a weight of at least 0 for each <bsdf> in it"));
        }
        // One after the other is blended in, so that each ends up with its share of the whole
        let whole = weights.iter().sum::<f64>().max(1.0);
        let mut taken = 1.0 - weights.iter().sum::<f64>() / whole;
        let mut mixed = Surface::one_sided(Material::diffuse([0.0; 3]));
        for (part, weight) in parts.iter().zip(&weights).filter(|(_, weight)| **weight > 0.0) {
            let next = self.surface(part)?;
            taken += weight / whole;
            let share = (weight / whole / taken) as f32;
            mixed = match share > 0.9999 {
                true => next,
                false => self.blended(element, mixed, next, Texture::Colour([share; 3]))?,
            };
        }
        Ok(mixed)
    }

    /// A clear coat over a surface: exact over a diffuse base, left out over any other.
    fn coating(&self, element: &'d Element) -> Result<Surface, LoadError> {
        if element.has("sigma_a") {
            self.approximated(
                element,
                format!("`sigma_a` of {} is left out: its coat is clear", element.species()),
            );
        }
        element.ignore(&["thickness", "sigma_a", "specular_sampling_weight"]);
        let rough = element.kind() == "roughcoating";
        let inside = self.surface(self.nested(element)?)?;
        let ior = self.relative_ior(element, "bk7")?;
        let specular = self.constant_factor(element, "specular_reflectance", 1.0)?;
        let facets = self.facets(element)?;
        let roughness = if rough { self.plain_roughness(element)? } else { 0.0 };
        match inside.body {
            Body::Plain(Material::Diffuse { albedo }) if ior > 1.0 => {
                let body = Body::Plain(Material::Plastic {
                    diffuse: albedo,
                    specular,
                    ior,
                    roughness,
                    nonlinear: true,
                });
                Ok(Surface { body, facets, ..inside })
            }
            _ => {
                self.approximated(element, format!("the coat of {} is left out", element.species()));
                Ok(inside)
            }
        }
    }

    /// Phong's and Ward's lobes on a diffuse base, of Mitsuba 0.6: a blend with microfacets of the same
    /// width.
    fn lobe_on_diffuse(&self, element: &'d Element) -> Result<Surface, LoadError> {
        element.ignore(&["variant"]);
        let (roughness, alphas) = if element.kind() == "phong" {
            let exponent = self.mean_float(element, "exponent")?.unwrap_or(30.0).max(0.0);
            // Where a lobe cosⁿ and Beckmann's distribution are alike (Walter et al. 2007, §5.2)
            ((2.0 / (exponent + 2.0)).sqrt().clamp(0.0, 1.0) as f32, None)
        } else {
            let [u, v] = [self.grey(element, "alpha_u", 0.1)?, self.grey(element, "alpha_v", 0.1)?];
            self.along_and_across(element, [&u, &v])?
        };
        self.approximated(
            element,
            format!("{} is replaced by Beckmann's microfacets on a diffuse base", element.species()),
        );
        let diffuse = self.factor(element, "diffuse_reflectance", 0.5)?;
        let specular = self.constant_factor(element, "specular_reflectance", 0.2)?;
        self.sum(element, diffuse, specular, (roughness, alphas))
    }

    /// The sum of a diffuse reflection and a glossy one that is the same at all angles.
    fn sum(
        &self,
        element: &Element,
        diffuse: Texture,
        specular: Rgb,
        (roughness, alphas): (f32, Option<Texture>),
    ) -> Result<Surface, LoadError> {
        let gloss = specular.into_iter().fold(0.0, f32::max);
        if let Texture::Image(image) = &diffuse {
            self.spend(element, image.width * image.height)?;
        }
        let base = peak(&diffuse);
        if gloss == 0.0 {
            return Ok(Surface::one_sided(Material::Diffuse { albedo: diffuse }));
        }
        // A blend takes a share of each, so each is scaled up. Together they reflect no more than there is
        let scale = 1.0 / (gloss + base).max(1.0);
        let share = gloss / (gloss + base);
        let glossy = Material::Conductor {
            eta: [0.0; 3],
            k: [1.0; 3],
            reflectance: Texture::Colour(specular.map(|c| (c * scale / share).min(1.0))),
            roughness,
        };
        let albedo = self.scaled(element, diffuse, scale / (1.0 - share).max(1e-6))?;
        let first = Surface::one_sided(Material::Diffuse { albedo });
        let facets = Facets::BeckmannUncorrelated;
        let glossy = Surface { facets, alphas, ..Surface::one_sided(glossy) };
        Ok(Surface::blend(first, glossy, Texture::Colour([share; 3])))
    }
}
