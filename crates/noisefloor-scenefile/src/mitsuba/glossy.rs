//! Surfaces with indices of refraction: conductors, dielectrics and plastics.

use super::context::Context;
use super::surface::Surface;
use super::xml::Element;
use crate::colour::Quantity;
use crate::error::LoadError;
use crate::indices;
use noisefloor::Rgb;
use noisefloor_ptwne::{Facets, Material, Texture};

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
            ([None, None], Some("none")) => match reflectance {
                Texture::Colour(reflectance) if !rough => {
                    return Ok(surface(Material::Mirror { reflectance }));
                }
                // Reflects all light at all angles
                _ => ([0.0; 3], [1.0; 3]),
            },
            ([None, None], name) => {
                // Mitsuba 0.6 took copper where nothing was said, Mitsuba 3 a perfect mirror
                let missing = if self.document.old { "Cu" } else { "none" };
                let name = name.unwrap_or(missing);
                match (name, &reflectance) {
                    ("none", Texture::Colour(reflectance)) if !rough => {
                        return Ok(surface(Material::Mirror { reflectance: *reflectance }));
                    }
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
        let (eta, k) = (self.clamped(element, "eta", relative(eta)), self.clamped(element, "k", relative(k)));
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
        let alphas = self.joined(element, [u, v], |[u, v]| [u, v, 0.0])?;
        Ok(match alphas {
            Texture::Colour([u, v, _]) if u == v => (u, None),
            Texture::Colour([u, v, _]) => ((u * v).sqrt(), Some(alphas)),
            other => {
                let [u, v, _] = self.means.of(&other);
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

    /// An index of refraction of a conductor, at least 0, with a warning if it is not.
    fn clamped(&self, element: &Element, name: &str, index: Rgb) -> Rgb {
        let nearest = index.map(|n| n.clamp(0.0, 100.0));
        if nearest != index {
            self.approximated(element, format!("`{name}` is {index:?}, and is brought into 0…100"));
        }
        nearest
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
