//! Materials of pbrt 3 and 4.

use super::colours::COPPER;
use super::reader::Reader;
use super::state::{Definition, Height, Look, plain};
use super::textures::Named;
use crate::error::{LoadError, Place};
use noisefloor::Rgb;
use noisefloor_ptwne::{
    Gloss, ImageTexture, Lobes, MIN_ROUGHNESS, Material, MaterialId, MaterialOptions, Relief, Texture,
};
use std::rc::Rc;

pub(super) enum Made {
    Plain(Material),
    /// Light passes as if there were nothing.
    Nothing,
    /// A share of the second.
    Mix(MaterialId, MaterialId, Texture),
}

impl Reader<'_> {
    /// The material of the shapes that come, where `alpha` is, and whether they shine.
    pub(super) fn current_material(
        &mut self,
        alpha: Option<(String, Texture)>,
        shines: bool,
        place: &Place,
    ) -> Result<MaterialId, LoadError> {
        let definition = match self.state.material.clone() {
            Look::Given(definition) => definition,
            Look::Named(name, here) => self.named(&name, &here)?,
        };
        if shines && matches!(definition.kind.as_str(), "interface" | "none" | "") {
            let refused = place.refused();
            return self.builder.material(Material::Nothing).map_err(refused);
        }
        self.known_or_made(&definition, alpha, place)
    }

    /// The material of a definition, made when first asked for.
    fn known_or_made(
        &mut self,
        definition: &Rc<Definition>,
        alpha: Option<(String, Texture)>,
        place: &Place,
    ) -> Result<MaterialId, LoadError> {
        let address = Rc::as_ptr(definition).addr();
        let (called, alpha) = alpha.unzip();
        // What is given stays in `kept`, so that no address is used twice
        if let Some(known) = self.materials.get(&(address, called.clone())) {
            return Ok(*known);
        }
        self.kept.push(definition.clone());
        self.load.bounds.begin(address, format_args!("the material `{}`", definition.kind), place)?;
        let id = self.material(definition, alpha);
        self.load.bounds.end();
        let id = id?;
        self.materials.insert((address, called), id);
        Ok(id)
    }

    /// Whether the material or the light of the shapes that come may have a texture.
    pub(super) fn is_textured(&self) -> bool {
        if self.state.area_light.as_ref().is_some_and(|light| light.emission.texture.is_some()) {
            return true;
        }
        let definition = match &self.state.material {
            Look::Given(definition) => Some(definition),
            Look::Named(name, _) => self.named_materials.get(name),
        };
        definition.is_some_and(|d| d.kind == "mix" || d.params.has_texture())
    }

    fn named(&self, name: &str, place: &Place) -> Result<Rc<Definition>, LoadError> {
        let found = self.named_materials.get(name).cloned();
        found.ok_or_else(|| place.bad(format!("there is no material `{name}`")))
    }

    fn material(
        &mut self,
        definition: &Definition,
        opacity: Option<Texture>,
    ) -> Result<MaterialId, LoadError> {
        let relief = self.relief(definition)?;
        let opacity = self.opacity(definition, opacity)?;
        let refused = definition.params.place.refused();
        let mut alphas = None;
        let made = self.made(definition, &mut alphas)?;
        let options = MaterialOptions { opacity, relief, roughness: alphas, ..MaterialOptions::default() };
        definition.params.ignore(&["type"]);
        self.say_unused(&definition.params, &format!("the material `{}`", definition.kind));
        match made {
            Made::Plain(material) => {
                let facets = (options.roughness.is_some(), options.facets);
                self.load.bounds.coat(&material, facets, &definition.params.place)?;
                self.builder.material_with(material, options).map_err(refused)
            }
            Made::Nothing => {
                let options = MaterialOptions { opacity: Some([0.0; 3].into()), ..options };
                self.builder.material_with(Material::diffuse([0.0; 3]), options).map_err(refused)
            }
            Made::Mix(first, second, share) => {
                self.builder.mixed_material(first, second, share, options).map_err(refused)
            }
        }
    }

    /// The opacity of `uber`, times that of the shape.
    fn opacity(&mut self, d: &Definition, of_shape: Option<Texture>) -> Result<Option<Texture>, LoadError> {
        let own = if d.kind == "uber" { self.texture_or_colour(d, "opacity")? } else { None };
        if own.as_ref().map(|texture| self.load.means.of(texture)).is_some_and(|[r, g, b]| r != g || g != b) {
            self.load.approximated(&d.params.place, "the colour of `opacity` is replaced by its mean");
        }
        Ok(match (own, of_shape) {
            (Some(own), Some(of_shape)) => Some(self.product(&d.params, own, of_shape)?),
            (own, of_shape) => own.or(of_shape),
        })
    }

    /// Bumps: heights of a texture, or a picture of normals.
    fn relief(&mut self, d: &Definition) -> Result<Option<Relief>, LoadError> {
        if let Some(name) = d.params.text("normalmap")? {
            return Ok(Some(Relief::Normals { map: self.normal_map(d, name)?, scale: 1.0, mirrors: false }));
        }
        for name in ["bumpmap", "displacement"] {
            let Some(param) = d.params.get(name) else { continue };
            if param.kind != "texture" {
                // A constant height
                continue;
            }
            let called = d.params.text(name)?.unwrap_or_default();
            if let Some(Height { map, scale }) = d.heights.get(called) {
                let map = Texture::Image(ImageTexture { nearest: false, ..map.clone() });
                return Ok(Some(Relief::Heights { map, scale: *scale }));
            }
            let what = format!("the relief `{name}` is left out: its texture is no picture times a number");
            self.load.ignored(&d.params.place, what);
        }
        Ok(None)
    }

    /// What a material becomes, and its α along and across u if they are no number.
    fn made(&mut self, d: &Definition, alphas: &mut Option<Texture>) -> Result<Made, LoadError> {
        let near = |what| replaced(d, what);
        Ok(Made::Plain(match d.kind.as_str() {
            "diffuse" => Material::Diffuse { albedo: self.colour(d, "reflectance", [0.5; 3])? },
            "matte" => {
                let (diffuse, sigma) =
                    (self.colour(d, "Kd", [0.5; 3])?, self.number(d, "sigma", 0.0)?.clamp(0.0, 90.0));
                if sigma == 0.0 {
                    Material::Diffuse { albedo: diffuse }
                } else {
                    Lobes { diffuse, sigma: sigma.to_radians() as f32, ..Lobes::default() }.into()
                }
            }
            "coateddiffuse" => {
                d.params.ignore(&["thickness", "g", "albedo", "maxdepth", "nsamples"]);
                self.load.approximated(&d.params.place, near("a coat on a Lambertian base"));
                let (base, roughness) =
                    (self.colour(d, "reflectance", [0.5; 3])?, self.roughness(d, "", 0.0, true, alphas)?);
                plastic(base, [1.0; 3], self.index(d, 1.5)?, roughness)
            }
            "plastic" | "uber" | "substrate" | "translucent" => self.lobes(d, alphas)?.into(),
            "conductor" | "metal" | "coatedconductor" => self.conductor(d, alphas)?,
            "mirror" => {
                let reflectance = self.colour(d, "Kr", [0.9; 3])?;
                Material::Mirror { reflectance: self.load.means.of(&reflectance) }
            }
            "dielectric" | "glass" | "thindielectric" => {
                let tint = self.colour(d, "Kt", [1.0; 3])?;
                let tint = self.load.means.of(&tint);
                if self.texture_or_colour(d, "Kr")?.is_some_and(|k| self.load.means.of(&k) != [1.0; 3]) {
                    let what = format!("`Kr` of the material `{}` is taken for 1", d.kind);
                    self.load.approximated(&d.params.place, what);
                }
                let ior = self.index(d, 1.5)?;
                if d.kind == "thindielectric" {
                    Material::ThinGlass { ior, tint }
                } else {
                    let roughness = self.roughness(d, "", 0.0, d.kind == "dielectric", alphas)?;
                    Material::RoughGlass { ior, tint, roughness }
                }
            }
            "disney" => return self.disney(d),
            "diffusetransmission" => {
                let scale = Texture::Colour([self.number(d, "scale", 1.0)?.max(0.0) as f32; 3]);
                let [diffuse, through] = ["reflectance", "transmittance"].map(|name| {
                    let colour = self.colour(d, name, [0.25; 3])?;
                    let scaled = self.product(&d.params, colour, scale.clone())?;
                    self.inside(&d.params.place, scaled)
                });
                Lobes { diffuse: diffuse?, through: through?, ..Lobes::default() }.into()
            }
            "subsurface" | "kdsubsurface" => {
                self.load.approximated(&d.params.place, near("a coat on a Lambertian base"));
                d.params.ignore(&["sigma_a", "sigma_s", "mfp", "scale", "g", "name"]);
                let roughness = self.roughness(d, "", 0.0, true, alphas)?;
                let name = if d.kind == "subsurface" { "reflectance" } else { "Kd" };
                plastic(self.colour(d, name, [0.5; 3])?, [1.0; 3], self.index(d, 1.33)?, roughness)
            }
            "interface" | "none" | "" => return Ok(Made::Nothing),
            "mix" => return self.mix(d),
            other => return Err(d.params.place.unsupported(format!("the material `{other}`"))),
        }))
    }

    /// The sums of lobes of version 3, but for what is perfectly specular besides facets.
    fn lobes(&mut self, d: &Definition, alphas: &mut Option<Texture>) -> Result<Lobes, LoadError> {
        let missing = if d.kind == "substrate" { 0.5 } else { 0.25 };
        let (diffuse, specular) = (self.colour(d, "Kd", [missing; 3])?, self.colour(d, "Ks", [missing; 3])?);
        let roughness = self.roughness(d, "", 0.1, false, alphas)?.max(MIN_ROUGHNESS);
        let lobes = Lobes { diffuse, specular, roughness, ..Lobes::default() };
        let dielectric = |ior| Gloss::Dielectric { ior };
        Ok(match d.kind.as_str() {
            // Its source has the two indices the wrong way round
            "plastic" => Lobes { gloss: dielectric(1.0 / 1.5), ..lobes },
            "substrate" => Lobes { gloss: Gloss::AshikhminShirley, ..lobes },
            "uber" => {
                if self.texture_or_colour(d, "Kt")?.is_some_and(|k| self.load.means.of(&k) != [0.0; 3]) {
                    self.load.approximated(&d.params.place, "`Kt` of the material `uber` is left out");
                }
                let mirror = self.colour(d, "Kr", [0.0; 3])?;
                Lobes { mirror, gloss: dielectric(self.index(d, 1.5)?), ..lobes }
            }
            _ => {
                let [reflect, transmit] =
                    [self.colour(d, "reflect", [0.5; 3])?, self.colour(d, "transmit", [0.5; 3])?];
                if self.load.means.of(&lobes.specular) != [0.0; 3]
                    && self.load.means.of(&transmit) != [0.0; 3]
                {
                    let what = "the glossy transmission of the material `translucent` is left out";
                    self.load.approximated(&d.params.place, what);
                }
                Lobes {
                    through: self.product(&d.params, lobes.diffuse.clone(), transmit)?,
                    diffuse: self.product(&d.params, lobes.diffuse, reflect.clone())?,
                    specular: self.product(&d.params, lobes.specular, reflect)?,
                    ..lobes
                }
            }
        })
    }

    fn conductor(&mut self, d: &Definition, alphas: &mut Option<Texture>) -> Result<Material, LoadError> {
        if d.kind == "coatedconductor" {
            self.load.approximated(&d.params.place, "the coat of a conductor is left out");
            d.params.ignore(&[
                "interface.roughness",
                "interface.uroughness",
                "interface.vroughness",
                "interface.eta",
                "thickness",
                "g",
                "albedo",
                "maxdepth",
                "nsamples",
            ]);
        }
        let prefix = if d.kind == "coatedconductor" { "conductor." } else { "" };
        let name = |name: &str| format!("{prefix}{name}");
        let missing = if d.kind == "metal" { 0.01 } else { 0.0 };
        let roughness = self.roughness(d, prefix, missing, d.kind != "metal", alphas)?;
        // The reflectance is without prefix (`CoatedConductorMaterial::Create`)
        if let Some(reflectance) = self.texture_or_colour(d, "reflectance")? {
            return Ok(Material::RoughConductor { reflectance, roughness });
        }
        // Version 3 takes the colours of spectra under an equal-energy white, as Mitsuba does
        let old = crate::indices::conductor("Cu").filter(|_| d.kind == "metal");
        let copper = old.unwrap_or(COPPER);
        let eta = self.metal_index(d, &name("eta"))?.unwrap_or(copper.0);
        let k = self.metal_index(d, &name("k"))?.unwrap_or(copper.1);
        Ok(Material::Conductor { eta, k, reflectance: [1.0; 3].into(), roughness })
    }

    fn mix(&mut self, d: &Definition) -> Result<Made, LoadError> {
        use super::params::Values;
        let names: Vec<String> = match d.params.get("materials").map(|p| &*p.values) {
            Some(Values::Texts(names)) => names.clone(),
            _ => ["namedmaterial1", "namedmaterial2"]
                .iter()
                .filter_map(|name| d.params.text(name).ok().flatten().map(str::to_owned))
                .collect(),
        };
        let [first, second] = names.as_slice() else {
            return Err(d.params.bad("a mix needs the names of two materials"));
        };
        let mut part = |name: &str| {
            let definition = self.named(name, &d.params.place)?;
            self.known_or_made(&definition, None, &d.params.place)
        };
        let (first, second) = (part(first)?, part(second)?);
        let share = self.colour(d, "amount", [0.5; 3])?;
        // In pbrt 3 the amount is that of the first
        if d.params.get("materials").is_none() {
            return Ok(Made::Mix(second, first, share));
        }
        Ok(Made::Mix(first, second, share))
    }

    /// A colour or texture in 0…1.
    pub(super) fn colour(&mut self, d: &Definition, name: &str, missing: Rgb) -> Result<Texture, LoadError> {
        Ok(self.texture_or_colour(d, name)?.unwrap_or(Texture::Colour(missing)))
    }

    pub(super) fn texture_or_colour(
        &mut self,
        d: &Definition,
        name: &str,
    ) -> Result<Option<Texture>, LoadError> {
        self.texture_of(d, name, [&d.colour_textures, &d.float_textures])
    }

    /// A number or a texture of numbers, in 0…1.
    pub(super) fn grey(&mut self, d: &Definition, name: &str, missing: f64) -> Result<Texture, LoadError> {
        match d.params.get(name).map(|p| p.kind.as_str()) {
            Some("texture") => {
                let found = self.texture_of(d, name, [&d.float_textures, &d.colour_textures])?;
                Ok(found.unwrap_or(Texture::Colour([missing as f32; 3])))
            }
            _ => Ok(Texture::Colour([d.params.float(name)?.unwrap_or(missing) as f32; 3])),
        }
    }

    /// A colour, or the texture that is called so: pbrt has two lists of them, which may share names.
    fn texture_of(
        &mut self,
        d: &Definition,
        name: &str,
        lists: [&Named; 2],
    ) -> Result<Option<Texture>, LoadError> {
        let Some(param) = d.params.get(name) else { return Ok(None) };
        if param.kind == "texture" {
            let called = d.params.text(name)?.unwrap_or_default();
            let found = lists.into_iter().find_map(|list| list.get(called)).cloned();
            let found = found.ok_or_else(|| d.params.bad(format!("there is no texture `{called}`")))?;
            return self.inside(&d.params.place, found).map(Some);
        }
        Ok(self.factor(&d.params, name)?.map(plain))
    }

    /// A number; of a texture its mean.
    pub(super) fn number(&mut self, d: &Definition, name: &str, missing: f64) -> Result<f64, LoadError> {
        if d.params.get(name).is_none_or(|p| p.kind != "texture") {
            return Ok(d.params.float(name)?.unwrap_or(missing));
        }
        let what = format!("the texture of `{name}` is replaced by its mean");
        self.load.approximated(&d.params.place, what);
        let texture = self.grey(d, name, missing)?;
        Ok(f64::from(self.load.means.of(&texture).iter().sum::<f32>() / 3.0))
    }

    /// The index of refraction: a number or a named glass.
    fn index(&self, d: &Definition, missing: f32) -> Result<f32, LoadError> {
        for name in ["eta", "index"] {
            if let Some([index, ..]) = self.factor(&d.params, name)? {
                return Ok(index.clamp(0.25, 4.0));
            }
        }
        Ok(missing)
    }
}

fn plastic(diffuse: Texture, specular: Rgb, ior: f32, roughness: f32) -> Material {
    let ior = ior.clamp(1.001, 4.0);
    Material::Plastic { diffuse, specular, ior, roughness, nonlinear: true }
}

/// A phrase for a warning.
pub(super) fn replaced(d: &Definition, what: &str) -> String {
    format!("the material `{}` is replaced by {what}", d.kind)
}
