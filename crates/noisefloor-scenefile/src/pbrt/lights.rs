//! Lights.

use super::environment;
use super::params::Params;
use super::reader::Reader;
use crate::error::LoadError;
use crate::picture::{self, Samples};
use glam::{DMat3, DVec3};
use noisefloor::{Rgb, display::srgb_decode};
use noisefloor_ptwne::{Emission, Environment, Falloff, Punctual};

impl Reader<'_> {
    /// Adds a `LightSource`.
    pub(super) fn light_source(&mut self, kind: &str, params: &Params) -> Result<(), LoadError> {
        let refused = Self::refused(&params.place);
        let to_world = self.state.to_world;
        let point = |name: &str, missing: DVec3| {
            Ok::<_, LoadError>(to_world.transform_point3(params.triple(name)?.unwrap_or(missing)))
        };
        let array = |v: DVec3| v.as_vec3().to_array();
        for power in ["power", "illuminance"] {
            if params.get(power).is_some() {
                self.approximated(&params.place, format!("`{power}` of a light is ignored"));
            }
        }
        match kind {
            "distant" => {
                let (from, to) = (point("from", DVec3::ZERO)?, point("to", DVec3::Z)?);
                let irradiance = self.exposed(self.light(params, "L")?);
                let direction = array((to - from).normalize_or_zero());
                self.builder.punctual(Punctual::Distant { direction, irradiance }).map_err(refused)
            }
            "point" => {
                let position = array(point("from", DVec3::ZERO)?);
                let intensity = self.exposed(self.light(params, "I")?);
                self.builder.punctual(Punctual::Point { position, intensity }).map_err(refused)
            }
            "spot" => {
                let (from, to) = (point("from", DVec3::ZERO)?, point("to", DVec3::Z)?);
                let outer = params.float("coneangle")?.unwrap_or(30.0);
                let inner = outer - params.float("conedeltaangle")?.unwrap_or(5.0);
                let intensity = self.exposed(self.light(params, "I")?);
                let (inner, outer) = (inner.clamp(0.0, 0.999 * outer) as f32, outer as f32);
                let direction = array((to - from).normalize_or_zero());
                let position = array(from);
                let falloff = if self.version_3 { Falloff::Fourth } else { Falloff::Smooth };
                let spot = Punctual::Spot { position, direction, intensity, inner, outer, falloff };
                self.builder.punctual(spot).map_err(refused)
            }
            "infinite" => self.infinite(params),
            _ => Err(params.place.clone().unsupported(format!("LightSource \"{kind}\""))),
        }
    }

    fn infinite(&mut self, params: &Params) -> Result<(), LoadError> {
        if self.surrounded {
            return Err(params.bad("a second light surrounds the scene; there can be only one"));
        }
        self.surrounded = true;
        let refused = Self::refused(&params.place);
        params.ignore(&["samples", "nsamples"]);
        let radiance = self.exposed(self.light(params, "L")?);
        let name = match params.text("filename")? {
            Some(name) => Some(name),
            None => params.text("mapname")?,
        };
        let Some(name) = name else {
            return self.builder.environment(Environment::constant(radiance)).map_err(refused);
        };
        let (width, height, mut pixels) = self.linear_picture(params, name)?;
        for pixel in &mut pixels {
            *pixel = std::array::from_fn(|i| (pixel[i] * radiance[i]).max(0.0));
        }
        let rotation = DMat3::from_mat4(self.state.to_world);
        let rotation = DMat3::from_cols(
            rotation.x_axis.normalize_or_zero(),
            rotation.y_axis.normalize_or_zero(),
            rotation.z_axis.normalize_or_zero(),
        );
        let map = if width == height {
            self.count_pixels(&params.place, 2 * width * height)?;
            environment::equal_area(width, &pixels, rotation)
        } else {
            environment::latitudes(width, height, pixels, rotation)
        };
        self.builder.environment_map(map).map_err(refused)
    }

    /// The linear values of a picture.
    fn linear_picture(&mut self, params: &Params, name: &str) -> Result<(usize, usize, Vec<Rgb>), LoadError> {
        let path = self.folder.find(name, &params.place)?;
        let picture = picture::read(&self.folder, &path, &params.place)?;
        self.count_pixels(&params.place, 2 * picture.width * picture.height)?;
        let decode = |code: f32| srgb_decode(code);
        let pixels: Vec<Rgb> = match picture.samples {
            Samples::Eight(codes) => {
                codes.iter().map(|[r, g, b, _]| [*r, *g, *b].map(|c| decode(f32::from(c) / 255.0))).collect()
            }
            Samples::Sixteen(codes) => codes
                .iter()
                .map(|[r, g, b, _]| [*r, *g, *b].map(|c| decode(f32::from(c) / 65535.0)))
                .collect(),
            Samples::Linear(values) => values,
        };
        if !pixels.iter().flatten().all(|v| v.is_finite()) {
            return Err(params.bad(format!("`{name}` has values that are not finite")));
        }
        Ok((picture.width, picture.height, pixels))
    }

    /// The light of the shapes that come, by an `AreaLightSource`.
    pub(super) fn emission(&mut self) -> Result<Option<Emission>, LoadError> {
        let Some(params) = self.state.area_light.clone() else { return Ok(None) };
        let radiance = self.exposed(self.light(&params, "L")?);
        let two_sided = params.switch("twosided", false)?;
        params.ignore(&["samples", "nsamples"]);
        for name in ["power", "filename"] {
            if params.get(name).is_some() {
                self.approximated(&params.place, format!("`{name}` of an area light is ignored"));
            }
        }
        self.say_unused(&params, "AreaLightSource");
        Ok((radiance != [0.0; 3]).then_some(Emission { radiance, texture: None, two_sided }))
    }

    /// Light as the film takes it.
    fn exposed(&self, light: Rgb) -> Rgb {
        light.map(|c| c * self.view.exposure)
    }
}
