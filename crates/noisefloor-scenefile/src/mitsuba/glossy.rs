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
            roughness: self.roughness(element, rough)?,
            nonlinear: self.boolean(element, "nonlinear", false)?,
        })
    }

    pub(super) fn conductor(&self, element: &'d Element) -> Result<Material, LoadError> {
        let rough = element.kind() == "roughconductor";
        let reflectance = self.factor(element, "specular_reflectance", 1.0)?;
        let roughness = self.roughness(element, rough)?;

        // η and k, or the name of a metal
        let given =
            [self.colour(element, "eta", Quantity::Factor)?, self.colour(element, "k", Quantity::Factor)?];
        let (eta, k) = match (given, self.string(element, "material")?) {
            // Given and named, the numbers count
            ([Some(eta), Some(k)], _) => (eta, k),
            ([None, None], Some("none")) => match reflectance {
                Texture::Colour(reflectance) if !rough => return Ok(Material::Mirror { reflectance }),
                // Reflects all light at all angles
                _ => ([0.0; 3], [1.0; 3]),
            },
            ([None, None], name) => {
                // Mitsuba 0.6 took copper where nothing was said, Mitsuba 3 a perfect mirror
                let missing = if self.document.old { "Cu" } else { "none" };
                let name = name.unwrap_or(missing);
                match (name, &reflectance) {
                    ("none", Texture::Colour(reflectance)) if !rough => {
                        return Ok(Material::Mirror { reflectance: *reflectance });
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
        Ok(Material::Conductor { eta: relative(eta), k: relative(k), reflectance, roughness })
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
                Material::RoughGlass { ior, tint, roughness: self.roughness(element, true)? }
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

    /// α.
    pub(super) fn roughness(&self, element: &'d Element, rough: bool) -> Result<f32, LoadError> {
        if !rough {
            return Ok(0.0);
        }
        element.ignore(&["sample_visible"]);
        let number = |name: &str| self.mean_float(element, name);
        let alpha = match (number("alpha")?, number("alpha_u")?, number("alpha_v")?) {
            (alpha, None, None) => alpha.unwrap_or(0.1),
            (alpha, u, v) => {
                let default = alpha.unwrap_or(0.1);
                let (u, v) = (u.unwrap_or(default), v.unwrap_or(default));
                if u != v {
                    self.approximated(element, "roughness that depends on direction is replaced by its mean");
                }
                (u * v).max(0.0).sqrt()
            }
        };
        if !(0.0..=1.0).contains(&alpha) {
            self.approximated(element, format!("a roughness of {alpha} is brought into 0…1"));
        }
        Ok(alpha.clamp(0.0, 1.0) as f32)
    }

    /// A number; of a texture its mean, with a warning.
    pub(super) fn mean_float(&self, element: &'d Element, name: &str) -> Result<Option<f64>, LoadError> {
        let tag = |child: &&Element| child.tag == "texture" || child.tag == "ref" || child.tag == "spectrum";
        match element.get(name).filter(tag) {
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
