//! Surfaces: Mitsuba's `bsdf` elements.

use super::context::Context;
use super::parts::{Body, Surface};
use super::textures::peak;
use super::xml::Element;
use crate::colour::Quantity;
use crate::error::LoadError;
use crate::indices;
use noisefloor::Rgb;
use noisefloor_ptwne::{Dialect, Facets, Lobes, Material, Principled, Relief, Texture};
use std::f32::consts::FRAC_1_SQRT_2;

/// Most surfaces that one mixes, whatever they are mixed of.
const MAX_MIXED: u64 = 256;

impl<'d> Context<'d> {
    /// A `bsdf`.
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

// Surfaces with indices of refraction: conductors, dielectrics and plastics.

impl<'d> Context<'d> {
    pub(super) fn plastic(&self, element: &'d Element) -> Result<Material, LoadError> {
        if element.kind() == "pplastic" {
            self.approximated(element, "the polarisation of <bsdf type=\"pplastic\"> is left out");
        }
        let rough = element.kind() == "roughplastic" || element.has("alpha");
        Ok(Material::Plastic {
            diffuse: self.factor(element, "diffuse_reflectance", 0.5)?,
            specular: self.constant_factor(element, "specular_reflectance", 1.0)?,
            ior: self.relative_ior(element, "polypropylene")?,
            roughness: if rough { self.plain_roughness(element)? } else { 0.0 },
            nonlinear: self.boolean(element, "nonlinear", false)?,
        })
    }

    pub(super) fn conductor(&self, element: &'d Element) -> Result<Surface, LoadError> {
        let rough = element.kind() == "roughconductor";
        let reflectance = self.factor(element, "specular_reflectance", 1.0)?;
        let (roughness, alphas) = self.roughness(element, rough)?;
        let facets = self.facets(element)?;
        let surface = |material| Surface { facets, alphas, ..Surface::one_sided(material) };

        // η and k, or the name of a metal
        let given =
            [self.signed(element, "eta", Quantity::Factor)?, self.signed(element, "k", Quantity::Factor)?];
        let (eta, k) = match (given, self.string(element, "material")?) {
            // Given and named, the numbers count
            ([Some(eta), Some(k)], _) => (eta, k),
            ([None, None], name) => {
                // Mitsuba 0.6 took copper where nothing was said, Mitsuba 3 a perfect mirror
                let missing = if self.document.old { "Cu" } else { "none" };
                let name = name.unwrap_or(missing);
                match (name, &reflectance) {
                    ("none", Texture::Colour(reflectance)) if !rough => {
                        return Ok(surface(Material::Mirror { reflectance: *reflectance }));
                    }
                    // Reflects all light at all angles
                    ("none", _) => ([0.0; 3], [1.0; 3]),
                    _ => indices::conductor(name).ok_or_else(|| {
                        let known: Vec<&str> = indices::CONDUCTORS.iter().map(|metal| metal.0).collect();
                        let known = known.join(", ");
                        let what = format!("the metal `{name}` (known: none, {known}; or give eta and k)");
                        self.unsupported(element, what)
                    })?,
                }
            }
            _ => return Err(self.bad(element, "give both `eta` and `k`, or `material`")),
        };
        // Relative to what is outside
        let outside = self.ior(element, "ext_eta", "vacuum")? as f32;
        let relative = |index: Rgb| index.map(|n| n / outside);
        let place = self.place(element);
        let clamped = |name: &str, index: Rgb| self.load.conductor_index(&place, name, relative(index));
        let (eta, k) = (clamped("eta", eta), clamped("k", k));
        Ok(surface(Material::Conductor { eta, k, reflectance, roughness }))
    }

    pub(super) fn glass(&self, element: &'d Element) -> Result<Surface, LoadError> {
        let reflectance = self.constant_factor(element, "specular_reflectance", 1.0)?;
        if reflectance != [1.0; 3] {
            self.ignored(element, format!("`specular_reflectance` {reflectance:?} is ignored: it is 1"));
        }
        let tint = self.constant_factor(element, "specular_transmittance", 1.0)?;
        let ior = self.relative_ior(element, "bk7")?;
        let facets = self.facets(element)?;
        let body = match element.kind() {
            "thindielectric" => Material::ThinGlass { ior, tint },
            // Mitsuba lets light through unbent
            _ if (ior - 1.0).abs() < 1e-6 => Material::ThinGlass { ior, tint },
            "roughdielectric" => {
                let (roughness, alphas) = self.roughness(element, true)?;
                let body = Material::RoughGlass { ior, tint, roughness };
                return Ok(Surface { facets, alphas, ..Surface::two_sided(body) });
            }
            _ => Material::Glass { ior, tint },
        };
        Ok(Surface { facets, ..Surface::two_sided(body) })
    }

    /// The distribution of microfacets. Phong's is one of lobes, which Beckmann's comes close to.
    pub(super) fn facets(&self, element: &'d Element) -> Result<Facets, LoadError> {
        match self.string(element, "distribution")?.unwrap_or("beckmann") {
            "ggx" => Ok(Facets::GgxUncorrelated),
            "beckmann" => Ok(Facets::BeckmannUncorrelated),
            other => {
                self.approximated(element, format!("the distribution `{other}` is replaced by `beckmann`"));
                Ok(Facets::BeckmannUncorrelated)
            }
        }
    }

    /// α, or a texture of it along and across u: of `alpha`, or of `alpha_u` and `alpha_v`.
    pub(super) fn roughness(
        &self,
        element: &'d Element,
        rough: bool,
    ) -> Result<(f32, Option<Texture>), LoadError> {
        if !rough {
            return Ok((0.0, None));
        }
        element.ignore(&["sample_visible"]);
        let [u, v] = if element.has("alpha_u") || element.has("alpha_v") {
            let missing = if element.has("alpha") { self.mean_float(element, "alpha")? } else { None };
            let missing = missing.unwrap_or(0.1) as f32;
            [self.grey(element, "alpha_u", missing)?, self.grey(element, "alpha_v", missing)?]
        } else {
            let alpha = self.grey(element, "alpha", 0.1)?;
            [alpha.clone(), alpha]
        };
        self.along_and_across(element, [&u, &v])
    }

    /// Two numbers or textures of α as one, which is a number if they are the same everywhere.
    pub(super) fn along_and_across(
        &self,
        element: &Element,
        [u, v]: [&Texture; 2],
    ) -> Result<(f32, Option<Texture>), LoadError> {
        let alphas = self.load.joined(&self.place(element), [u, v], |[u, v]| [u, v, 0.0])?;
        Ok(match alphas {
            Texture::Colour([u, v, _]) if u == v => (u, None),
            Texture::Colour([u, v, _]) => ((u * v).sqrt(), Some(alphas)),
            other => {
                let [u, v, _] = self.load.means.of(&other);
                ((u * v).sqrt(), Some(other))
            }
        })
    }

    /// One α for all directions and places.
    pub(super) fn plain_roughness(&self, element: &'d Element) -> Result<f32, LoadError> {
        match self.roughness(element, true)? {
            (alpha, None) => Ok(alpha),
            (alpha, Some(_)) => {
                self.approximated(element, "roughness that varies is replaced by its mean");
                Ok(alpha)
            }
        }
    }

    /// A number of 0…1 or a texture of it.
    pub(super) fn grey(&self, element: &'d Element, name: &str, missing: f32) -> Result<Texture, LoadError> {
        let texture = match element.get(name) {
            Some(child) if !matches!(child.tag.as_str(), "float" | "integer") => {
                self.factor(element, name, missing)?
            }
            _ => {
                let number = self.float(element, name)?.unwrap_or(f64::from(missing));
                if !(0.0..=1.0).contains(&number) {
                    self.approximated(element, format!("`{name}` is {number}, and is brought into 0…1"));
                }
                return Ok(Texture::Colour([number.clamp(0.0, 1.0) as f32; 3]));
            }
        };
        let texture = self.varying(element, texture)?;
        self.one_channel(element, texture)
    }

    /// A number; of a colour the mean of its channels, as in Mitsuba; of a texture its mean, with a warning.
    pub(super) fn mean_float(&self, element: &'d Element, name: &str) -> Result<Option<f64>, LoadError> {
        let number = |child: &&Element| matches!(child.tag.as_str(), "float" | "integer");
        match element.get(name).filter(|child| !number(child)) {
            Some(_) => {
                let mean = self.constant_factor(element, name, 0.0)?;
                Ok(Some(f64::from(mean.iter().sum::<f32>() / 3.0)))
            }
            None => self.float(element, name),
        }
    }

    /// Index of refraction of the inside over that of the outside.
    pub(super) fn relative_ior(&self, element: &'d Element, inside: &str) -> Result<f32, LoadError> {
        let (inside, outside) = (self.ior(element, "int_ior", inside)?, self.ior(element, "ext_ior", "air")?);
        Ok((inside / outside) as f32)
    }

    /// An index of refraction above 0: a number or a name, or else that of `default`.
    fn ior(&self, element: &'d Element, name: &str, default: &str) -> Result<f64, LoadError> {
        let found = match element.get(name) {
            None => indices::dielectric(default),
            Some(child) if child.tag == "string" => {
                let material = child.attribute("value").unwrap_or_default();
                Some(indices::dielectric(material).ok_or_else(|| {
                    let known: Vec<&str> = indices::DIELECTRICS.iter().map(|index| index.0).collect();
                    self.unsupported(
                        child,
                        format!("the material `{material}` (known: {})", known.join(", ")),
                    )
                })?)
            }
            Some(_) => self.float(element, name)?,
        };
        let found = found.filter(|ior| *ior > 0.0);
        found.ok_or_else(|| self.bad(element, format!("`{name}` must be above 0")))
    }
}

// Disney's principled surface (Burley 2012, 2015) as Mitsuba 3 has it.

/// What the surface is beside a diffuse and a glossy reflection.
struct Glass {
    /// Share of what is no metal.
    share: f64,
    thin: bool,
    ior: f32,
}

impl<'d> Context<'d> {
    /// `principled` or `principledthin`.
    pub(super) fn principled(&self, element: &'d Element) -> Result<Surface, LoadError> {
        let thin = element.kind() == "principledthin";
        if thin {
            self.approximated(
                element,
                "of <bsdf type=\"principledthin\"> what is seen from behind is left out, but for a pane",
            );
            element.ignore(&["diff_trans"]);
        }
        element.ignore(&[
            "diffuse_reflectance_sampling_rate",
            "specular_reflectance_sampling_rate",
            "clearcoat_sampling_rate",
            "main_specular_sampling_rate",
        ]);
        let number = |name: &str, missing: f64| {
            let number = self.mean_float(element, name)?.unwrap_or(missing);
            if !(0.0..=1.0).contains(&number) {
                self.approximated(element, format!("`{name}` is {number}, and is brought into 0…1"));
            }
            Ok::<_, LoadError>(number.clamp(0.0, 1.0))
        };
        let ior = self.principled_ior(element)?;
        let base = self.factor(element, "base_color", 0.5)?;
        let (roughness, metal) =
            (self.grey(element, "roughness", 0.5)?, self.grey(element, "metallic", 0.0)?);
        let surface = Principled {
            base: base.clone(),
            metallic_roughness: self
                .load
                .joined(&self.place(element), [&roughness, &metal], |[r, m]| [1.0, r, m])?,
            ior: ior.clamp(1.0, 4.0),
            anisotropic: number("anisotropic", 0.0)? as f32,
            specular_tint: number("spec_tint", 0.0)? as f32,
            sheen: number("sheen", 0.0)? as f32,
            sheen_tint: number("sheen_tint", 0.0)? as f32,
            flatness: number("flatness", 0.0)? as f32,
            clearcoat: number("clearcoat", 0.0)? as f32,
            clearcoat_gloss: number("clearcoat_gloss", 0.0)? as f32,
            dialect: Dialect::Mitsuba,
        };
        match number("spec_trans", 0.0)? {
            0.0 => Ok(Surface::one_sided(surface.into())),
            share => self.with_glass(element, surface, [&roughness, &metal], Glass { share, thin, ior }),
        }
    }

    fn principled_ior(&self, element: &'d Element) -> Result<f32, LoadError> {
        let ior = match self.float(element, "eta")? {
            Some(eta) => eta,
            // Burley 2012: 0.08·specular at normal incidence
            None => {
                let specular = self.mean_float(element, "specular")?.unwrap_or(0.5);
                let root = (0.08 * specular).max(0.0).sqrt().min(0.9);
                (1.0 + root) / (1.0 - root)
            }
        };
        if !(0.25..=4.0).contains(&ior) {
            self.approximated(element, format!("an index of refraction of {ior} is brought into 0.25…4"));
        }
        Ok(ior.clamp(0.25, 4.0) as f32)
    }

    /// A mix with glass. It is exact: with metal m and transmission t, the glass has the share s = (1 − m)t,
    /// with its part of the dielectric's reflection, and the rest is a surface of metal m/(1 − s).
    fn with_glass(
        &self,
        element: &'d Element,
        surface: Principled,
        [roughness, metal]: [&Texture; 2],
        Glass { share, thin, ior }: Glass,
    ) -> Result<Surface, LoadError> {
        if !matches!(metal, Texture::Colour(_)) {
            let what = "the texture of `metallic` counts by its mean in how much is transmitted";
            self.approximated(element, what);
        }
        if matches!(surface.base, Texture::Image(_)) {
            self.approximated(element, "the tint of transmitted light is the mean of `base_color`");
        }
        let tint = self.load.means.of(&surface.base).map(f32::sqrt);
        let metallic = self.load.means.of(metal)[0];
        let share = (1.0 - metallic) * share as f32;
        let aspect = (1.0 - 0.9 * surface.anisotropic).sqrt();
        let square = |r: f32| [r * r / aspect, r * r * aspect, 0.0];
        let alphas = self.load.joined(&self.place(element), [roughness], |[r]| square(r))?;
        let glass = match alphas {
            _ if thin => Surface::two_sided(Material::ThinGlass { ior, tint }),
            Texture::Colour([u, v, _]) if u == v => {
                Surface::two_sided(Material::RoughGlass { ior, tint, roughness: u })
            }
            alphas => {
                let body = Material::RoughGlass { ior, tint, roughness: self.load.means.of(&alphas)[0] };
                Surface { alphas: Some(alphas), ..Surface::two_sided(body) }
            }
        };
        if share >= 1.0 {
            return Ok(glass);
        }
        let rest = metallic / (1.0 - share);
        let metallic_roughness = self.load.joined(&self.place(element), [roughness], |[r]| [1.0, r, rest])?;
        let surface = Surface::one_sided(Principled { metallic_roughness, ..surface }.into());
        Ok(Surface::blend(surface, glass, Texture::Colour([share; 3])))
    }
}
