//! How rough and how metallic materials are, by number, picture and direction; and Disney's surface.

use super::materials::Made;
use super::reader::Reader;
use super::state::Definition;
use crate::error::LoadError;
use noisefloor::Rgb;
use noisefloor_ptwne::{Dialect, Material, MaterialOptions, Principled, Texture};

impl Reader<'_> {
    /// GGX α: pbrt 4 takes the square root of its roughness, pbrt 3 a polynomial of its logarithm. Into
    /// `alphas` comes what varies by place or direction.
    pub(super) fn roughness(
        &mut self,
        d: &Definition,
        prefix: &str,
        missing: f64,
        fourth: bool,
        alphas: &mut Option<Texture>,
    ) -> Result<f32, LoadError> {
        let both = self.grey(d, &format!("{prefix}roughness"), missing)?;
        let mut side = |name: &str| {
            let name = format!("{prefix}{name}");
            if d.params.get(&name).is_some() { self.grey(d, &name, missing) } else { Ok(both.clone()) }
        };
        let (u, v) = (side("uroughness")?, side("vroughness")?);
        let remapped = d.params.switch("remaproughness", true)?;
        // Of version 3 only glass can be smooth
        let smooth = d.kind == "glass";
        let alpha = |roughness: f32| match remapped {
            false => roughness,
            true if fourth => roughness.max(0.0).sqrt(),
            true if smooth && roughness == 0.0 => 0.0,
            true => {
                let x = roughness.max(1e-3).ln();
                1.621_42 + x * (0.819_955 + x * (0.1734 + x * (0.017_120_1 + x * 0.000_640_711)))
            }
        };
        let found = self.load.joined(&d.params.place, [&u, &v], |[u, v]| [alpha(u), alpha(v), 0.0])?;
        let [u, v, _] = self.load.means.of(&found);
        *alphas = Some(found).filter(|found| u != v || !matches!(found, Texture::Colour(_)));
        Ok((u * v).max(0.0).sqrt().min(1.0))
    }

    /// η or k of a conductor.
    pub(super) fn metal_index(&mut self, d: &Definition, name: &str) -> Result<Option<Rgb>, LoadError> {
        let index = self.signed(&d.params, name)?;
        Ok(index.map(|index| self.load.conductor_index(&d.params.place, name, index)))
    }

    /// `disney`, of version 3.
    pub(super) fn disney(&mut self, d: &Definition) -> Result<Made, LoadError> {
        let base = self.colour(d, "color", [0.5; 3])?;
        let (roughness, metal) = (self.grey(d, "roughness", 0.5)?, self.grey(d, "metallic", 0.0)?);
        let mut number = |name: &str, missing: f64| {
            Ok::<_, LoadError>(self.number(d, name, missing)?.clamp(0.0, 1.0) as f32)
        };
        let surface = Principled {
            base: base.clone(),
            anisotropic: number("anisotropic", 0.0)?,
            specular_tint: number("speculartint", 0.0)?,
            sheen: number("sheen", 0.0)?,
            sheen_tint: number("sheentint", 0.5)?,
            clearcoat: number("clearcoat", 0.0)?,
            clearcoat_gloss: number("clearcoatgloss", 1.0)?,
            dialect: Dialect::Pbrt,
            ..Principled::default()
        };
        let transmission = number("spectrans", 0.0)?;
        let ior = self.number(d, "eta", 1.5)? as f32;
        for (name, what) in [
            ("thin", "the thin surface is seen as a thick one"),
            ("scatterdistance", "light is scattered at the surface, not below it"),
        ] {
            if d.params.get(name).is_some() {
                self.load.approximated(&d.params.place, format!("`{name}` of `disney` is left out: {what}"));
            }
        }
        d.params.ignore(&["flatness", "difftrans"]);

        // With metal m and transmission t, glass has the share s = (1 − m)t and the rest is of metal m/(1 −
        // s)
        let metallic = self.load.means.of(&metal)[0];
        let share = (1.0 - metallic) * transmission;
        let metal =
            if share > 0.0 && share < 1.0 { Texture::Colour([metallic / (1.0 - share); 3]) } else { metal };
        let metallic_roughness =
            self.load.joined(&d.params.place, [&roughness, &metal], |[r, m]| [1.0, r, m])?;
        let surface = Principled { metallic_roughness, ior: ior.clamp(1.0, 4.0), ..surface };
        if share <= 0.0 {
            return Ok(Made::Plain(surface.into()));
        }
        self.load.approximated(&d.params.place, "transmission of `disney` has its mean roughness and tint");
        let refused = d.params.place.refused();
        let roughness = self.load.means.of(&roughness)[0].powi(2);
        let tint = self.load.means.of(&base).map(f32::sqrt);
        let glass = Material::RoughGlass { ior: ior.clamp(0.25, 4.0), tint, roughness };
        if share >= 1.0 {
            return Ok(Made::Plain(glass));
        }
        let first =
            self.builder.material_with(surface.into(), MaterialOptions::default()).map_err(&refused)?;
        let second = self.builder.material_with(glass, MaterialOptions::default()).map_err(&refused)?;
        Ok(Made::Mix(first, second, Texture::Colour([share; 3])))
    }
}
