//! Surfaces: Mitsuba's `bsdf` elements.

use super::context::Context;
use super::surface::Surface;
use super::values::Use;
use super::xml::Element;
use crate::error::LoadError;
use noisefloor::Rgb;
use noisefloor_ptwne::{Cover, Material, Texture};

/// How deep surfaces may nest.
const MAX_NESTED: u64 = 16;

/// Indices of refraction that have names: visible light, room temperature.
const INDICES: [(&str, f64); 14] = [
    ("vacuum", 1.0),
    ("air", 1.000_277),
    ("water ice", 1.31),
    ("water", 1.333),
    ("ethanol", 1.361),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("glycerol", 1.4729),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("pet", 1.575),
    ("diamond", 2.419),
];

/// Complex indices of refraction of metals, as Rec.709 has them: η and k, as Mitsuba 3.9 averages them over
/// its spectra.
const METALS: [(&str, Rgb, Rgb); 6] = [
    ("Ag", [0.155_276, 0.116_728, 0.138_388], [4.828_35, 3.122_22, 2.146_9]),
    ("Al", [1.657_5, 0.880_405, 0.521_244], [9.223_81, 6.269_5, 4.837]),
    ("Au", [0.143_036, 0.375_307, 1.442_05], [3.983, 2.385_56, 1.603_36]),
    ("Cr", [4.369_67, 2.916_51, 1.654_9], [5.206_55, 4.231_31, 3.754_7]),
    ("Cu", [0.201_005, 0.923_75, 1.102_22], [3.913_26, 2.453_05, 2.142_09]),
    ("W", [4.370_82, 3.300_25, 2.998_41], [3.500_64, 2.604_87, 2.273_23]),
];

impl<'d> Context<'d> {
    /// A `bsdf`.
    ///
    /// # Errors
    /// [`LoadError`] if it is broken, of a kind that is not supported, or in itself.
    pub(super) fn surface(&self, element: &'d Element) -> Result<Surface, LoadError> {
        let serial = element.serial;
        if let Some(known) = self.surfaces.borrow().get(&serial) {
            return Ok(known.clone());
        }
        if self.open.borrow().contains(&serial) {
            return Err(self.bad(element, format!("{} refers to itself", element.label())));
        }
        // By reference, surfaces may nest deeper than elements do
        self.open.borrow_mut().push(serial);
        self.place(element).at_most("nested surfaces", self.open.borrow().len() as u64, MAX_NESTED)?;
        let surface = self.surface_of_kind(element)?;
        self.open.borrow_mut().pop();
        self.surfaces.borrow_mut().insert(serial, surface.clone());
        Ok(surface)
    }

    fn surface_of_kind(&self, element: &'d Element) -> Result<Surface, LoadError> {
        match element.kind() {
            "diffuse" => {
                // Older versions have another name for it, too
                let name = if element.get("diffuse_reflectance").is_some() {
                    "diffuse_reflectance"
                } else {
                    "reflectance"
                };
                Ok(Surface::one_sided(Material::Diffuse { albedo: self.factor(element, name, 0.5)? }))
            }
            "plastic" | "roughplastic" => self.plastic(element).map(Surface::one_sided),
            "conductor" | "roughconductor" => self.conductor(element).map(Surface::one_sided),
            "dielectric" => self.glass(element, "bk7", |ior, tint| Material::Glass { ior, tint }),
            "thindielectric" => self.glass(element, "bk7", |ior, tint| Material::ThinGlass { ior, tint }),
            "twosided" => {
                let mut surface = self.surface(self.nested(element)?)?;
                surface.cover.one_sided = false;
                Ok(surface)
            }
            "mask" => {
                let surface = self.surface(self.nested(element)?)?;
                if surface.cover.opacity.is_some() {
                    return Err(self.unsupported(element, "a mask in a mask"));
                }
                let opacity = self.luminance(element, self.factor(element, "opacity", 0.5)?)?;
                Ok(Surface { cover: Cover { opacity: Some(opacity), ..surface.cover }, ..surface })
            }
            kind @ ("bumpmap" | "normalmap") => {
                self.warn(element, format!("the relief of <bsdf type=\"{kind}\"> is left out: it is smooth"));
                element.children.iter().filter(|c| c.tag == "texture").for_each(Element::irrelevant);
                element.ignore(&["scale", "normalmap"]);
                self.surface(self.nested(element)?)
            }
            _ => Err(self.unsupported(element, element.label())),
        }
    }

    /// The one surface in another.
    fn nested(&self, element: &'d Element) -> Result<&'d Element, LoadError> {
        let parts = self.parts(element, "bsdf")?;
        match parts.as_slice() {
            [one] => Ok(one),
            [] => Err(self.bad(element, format!("{} needs a <bsdf> in it", element.label()))),
            _ => {
                Err(self.unsupported(element, format!("{} with more than one <bsdf> in it", element.label())))
            }
        }
    }

    fn plastic(&self, element: &'d Element) -> Result<Material, LoadError> {
        Ok(Material::Plastic {
            diffuse: self.factor(element, "diffuse_reflectance", 0.5)?,
            specular: self.constant_factor(element, "specular_reflectance", 1.0)?,
            ior: self.relative_ior(element, "polypropylene")?,
            roughness: self.roughness(element, element.kind() == "roughplastic")?,
            nonlinear: self.boolean(element, "nonlinear", false)?,
        })
    }

    fn conductor(&self, element: &'d Element) -> Result<Material, LoadError> {
        let rough = element.kind() == "roughconductor";
        let reflectance = self.factor(element, "specular_reflectance", 1.0)?;
        let roughness = self.roughness(element, rough)?;

        // η and k, or the name of a metal
        let given = [self.colour(element, "eta", Use::Factor)?, self.colour(element, "k", Use::Factor)?];
        let (eta, k) = match (given, self.string(element, "material")?) {
            ([Some(eta), Some(k)], None) => (eta, k),
            ([None, None], Some("none") | None) => match reflectance {
                Texture::Colour(reflectance) if !rough => return Ok(Material::Mirror { reflectance }),
                // Reflects all light at all angles
                _ => ([0.0; 3], [1.0; 3]),
            },
            ([None, None], Some(name)) => match METALS.iter().find(|metal| metal.0 == name) {
                Some((_, eta, k)) => (*eta, *k),
                None => {
                    let known: Vec<&str> = METALS.iter().map(|metal| metal.0).collect();
                    let what =
                        format!("the metal `{name}` (known: none, {}; or give eta and k)", known.join(", "));
                    return Err(self.unsupported(element, what));
                }
            },
            _ => return Err(self.bad(element, "give both `eta` and `k`, or `material`")),
        };
        // Relative to what is outside
        let outside = self.ior(element, "ext_eta", "vacuum")? as f32;
        let relative = |index: Rgb| index.map(|n| n / outside);
        Ok(Material::Conductor { eta: relative(eta), k: relative(k), reflectance, roughness })
    }

    fn glass(
        &self,
        element: &'d Element,
        inside: &str,
        material: fn(f32, Rgb) -> Material,
    ) -> Result<Surface, LoadError> {
        let reflectance = self.constant_factor(element, "specular_reflectance", 1.0)?;
        if reflectance != [1.0; 3] {
            self.warn(element, format!("`specular_reflectance` {reflectance:?} is ignored: it is 1"));
        }
        let tint = self.constant_factor(element, "specular_transmittance", 1.0)?;
        Ok(Surface::two_sided(material(self.relative_ior(element, inside)?, tint)))
    }

    /// GGX α.
    fn roughness(&self, element: &'d Element, rough: bool) -> Result<f32, LoadError> {
        if !rough {
            return Ok(0.0);
        }
        element.ignore(&["sample_visible"]);
        match self.string(element, "distribution")?.unwrap_or("beckmann") {
            "ggx" => {}
            other => self
                .warn(element, format!("the distribution `{other}` is replaced by `ggx` of the same alpha")),
        }
        let number = |name: &str| match element.get(name) {
            Some(texture) if texture.tag == "texture" || texture.tag == "ref" => {
                Err(self.unsupported(texture, format!("a texture as `{name}`")))
            }
            _ => self.float(element, name),
        };
        let alpha = match (number("alpha")?, number("alpha_u")?, number("alpha_v")?) {
            (alpha, None, None) => alpha.unwrap_or(0.1),
            (None, Some(u), Some(v)) if u == v => u,
            _ => return Err(self.unsupported(element, "roughness that depends on direction")),
        };
        Ok(alpha as f32)
    }

    /// Index of refraction of the inside over that of the outside.
    fn relative_ior(&self, element: &'d Element, inside: &str) -> Result<f32, LoadError> {
        let (inside, outside) = (self.ior(element, "int_ior", inside)?, self.ior(element, "ext_ior", "air")?);
        Ok((inside / outside) as f32)
    }

    /// An index of refraction above 0: a number or a name, or else that of `default`.
    fn ior(&self, element: &'d Element, name: &str, default: &str) -> Result<f64, LoadError> {
        let by_name = |name: &str| INDICES.iter().find(|index| index.0 == name).map(|index| index.1);
        let found = match element.get(name) {
            None => by_name(default),
            Some(child) if child.tag == "string" => {
                let material = child.attribute("value").unwrap_or_default();
                Some(by_name(material).ok_or_else(|| {
                    let known: Vec<&str> = INDICES.iter().map(|index| index.0).collect();
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
