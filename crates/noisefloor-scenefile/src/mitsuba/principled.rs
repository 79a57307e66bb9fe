//! Disney's principled surface (Burley 2012, 2015) as Mitsuba 3 has it.

use super::context::Context;
use super::surface::Surface;
use super::xml::Element;
use crate::error::LoadError;
use noisefloor_ptwne::{Dialect, Material, Principled, Texture};

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
            metallic_roughness: self.joined(element, [&roughness, &metal], |[r, m]| [1.0, r, m])?,
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
        let tint = self.means.of(&surface.base).map(f32::sqrt);
        let metallic = self.means.of(metal)[0];
        let share = (1.0 - metallic) * share as f32;
        let aspect = (1.0 - 0.9 * surface.anisotropic).sqrt();
        let square = |r: f32| [r * r / aspect, r * r * aspect, 0.0];
        let alphas = self.joined(element, [roughness], |[r]| square(r))?;
        let glass = match alphas {
            _ if thin => Surface::two_sided(Material::ThinGlass { ior, tint }),
            Texture::Colour([u, v, _]) if u == v => {
                Surface::two_sided(Material::RoughGlass { ior, tint, roughness: u })
            }
            alphas => {
                let body = Material::RoughGlass { ior, tint, roughness: self.means.of(&alphas)[0] };
                Surface { alphas: Some(alphas), ..Surface::two_sided(body) }
            }
        };
        if share >= 1.0 {
            return Ok(glass);
        }
        let rest = metallic / (1.0 - share);
        let metallic_roughness = self.joined(element, [roughness], |[r]| [1.0, r, rest])?;
        let surface = Surface::one_sided(Principled { metallic_roughness, ..surface }.into());
        Ok(Surface::blend(surface, glass, Texture::Colour([share; 3])))
    }
}
