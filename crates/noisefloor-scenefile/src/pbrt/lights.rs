//! Lights.

use super::environment;
use super::params::Params;
use super::reader::Reader;
use super::state::AreaLight;
use crate::channels::linear;
use crate::error::LoadError;
use crate::mesh::axes;
use crate::picture;
use glam::DVec3;
use noisefloor::{Rgb, display::luminance};
use noisefloor_ptwne::{Emission, Environment, Falloff, ImageTexture, Pixels, Punctual, Texture, Wrap};
use std::f64::consts::PI;

impl Reader<'_> {
    pub(super) fn light_source(&mut self, kind: &str, params: &Params) -> Result<(), LoadError> {
        let refused = params.place.refused();
        let to_world = self.state.to_world;
        let point = |name: &str, missing: DVec3| {
            Ok::<_, LoadError>(to_world.transform_point3(params.triple(name)?.unwrap_or(missing)))
        };
        let array = |v: DVec3| v.as_vec3().to_array();
        // Lights are of luminance 1 times what is asked for (`Create` of each in pbrt-v4's lights.cpp)
        let asked = |name: &str| self.photometric(params, name);
        match kind {
            "distant" => {
                let (from, to) = (point("from", DVec3::ZERO)?, point("to", DVec3::Z)?);
                let illuminance = asked("illuminance")?.unwrap_or(1.0);
                let irradiance = times(illuminance, self.light(params, "L")?);
                let direction = array((to - from).normalize_or_zero());
                self.builder.punctual(Punctual::Distant { direction, irradiance }).map_err(refused)
            }
            "point" => {
                let position = array(point("from", DVec3::ZERO)?);
                let intensity = asked("power")?.map_or(1.0, |power| power / (4.0 * PI));
                let intensity = times(intensity, self.light(params, "I")?);
                self.builder.punctual(Punctual::Point { position, intensity }).map_err(refused)
            }
            "spot" => {
                let (from, to) = (point("from", DVec3::ZERO)?, point("to", DVec3::Z)?);
                let outer = params.float("coneangle")?.unwrap_or(30.0);
                let inner = outer - params.float("conedeltaangle")?.unwrap_or(5.0);
                let [start, end] = [inner, outer].map(|angle: f64| angle.to_radians().cos());
                // The solid angle of the inner cone, and half of that between both
                let cone = 2.0 * PI * ((1.0 - start) + (start - end) / 2.0);
                let intensity = asked("power")?.map_or(1.0, |power| power / cone);
                let intensity = times(intensity, self.light(params, "I")?);
                let (inner, outer) = (inner.clamp(0.0, 0.999 * outer) as f32, outer as f32);
                let direction = array((to - from).normalize_or_zero());
                let position = array(from);
                let falloff = if self.version_3 { Falloff::Fourth } else { Falloff::Smooth };
                let spot = Punctual::Spot { position, direction, intensity, inner, outer, falloff };
                self.builder.punctual(spot).map_err(refused)
            }
            "infinite" => self.infinite(params),
            _ => Err(params.place.unsupported(format!("LightSource \"{kind}\""))),
        }
    }

    fn infinite(&mut self, params: &Params) -> Result<(), LoadError> {
        if self.surrounded {
            return Err(params.bad("a second light surrounds the scene; there can be only one"));
        }
        self.surrounded = true;
        let refused = params.place.refused();
        params.ignore(&["samples", "nsamples"]);
        let illuminance = self.photometric(params, "illuminance")?;
        let radiance = self.light(params, "L")?;
        let name = match params.text("filename")? {
            Some(name) => Some(name),
            None => params.text("mapname")?,
        };
        let Some(name) = name else {
            let radiance = radiance.map(|c| (f64::from(c) * illuminance.map_or(1.0, |e| e / PI)) as f32);
            return self.builder.environment(Environment::constant(radiance)).map_err(refused);
        };
        let (width, height, mut pixels) = self.linear_picture(params, name)?;
        let by = match illuminance {
            Some(asked) => asked / self.upward_illuminance(params, width, height, &pixels)?,
            None => 1.0,
        };
        for pixel in &mut pixels {
            *pixel = std::array::from_fn(|i| (f64::from(pixel[i] * radiance[i]) * by).max(0.0) as f32);
        }
        let (width, pixels) = if width == height {
            self.load.count_pixels(&params.place, 2 * width * height)?;
            (2 * width, environment::equal_area(width, &pixels))
        } else {
            (width, pixels)
        };
        let map = environment::latitudes(width, height, pixels, axes(self.state.to_world));
        self.builder.environment_map(map).map_err(refused)
    }

    /// The linear values of a picture.
    fn linear_picture(&mut self, params: &Params, name: &str) -> Result<(usize, usize, Vec<Rgb>), LoadError> {
        let path = self.load.folder.find(name, &params.place)?;
        let picture = picture::read(&self.load.folder, &path, &params.place)?;
        self.load.count_pixels(&params.place, 2 * picture.width * picture.height)?;
        let pixels = linear(&picture.samples.pixels(false));
        if !pixels.iter().flatten().all(|v| v.is_finite()) {
            return Err(params.bad(format!("`{name}` has values that are not finite")));
        }
        Ok((picture.width, picture.height, pixels))
    }

    /// What pbrt takes for the illuminance of a map of its own on a patch that faces up, in the light's own coordinates:
    /// with a factor of 2π, where pixels of equal areas have 4π of the sphere (`Light::Create` in lights.cpp).
    fn upward_illuminance(
        &self,
        params: &Params,
        width: usize,
        height: usize,
        pixels: &[Rgb],
    ) -> Result<f64, LoadError> {
        if width != height {
            return Err(params.bad("`illuminance` needs a square map, as those of pbrt 4 are"));
        }
        let sum: f64 = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| {
                let cosine = environment::height([x, y].map(|i| (i as f64 + 0.5) / width as f64)).max(0.0);
                f64::from(luminance(pixels[y * width + x])) * cosine
            })
            .sum();
        let illuminance = sum * 2.0 * PI / (width * height) as f64;
        if illuminance > 0.0 {
            Ok(illuminance)
        } else {
            Err(params.bad("`illuminance` needs a map that has light above the horizon"))
        }
    }

    /// The light of the shapes that come, by an `AreaLightSource`; none if it is black.
    pub(super) fn area_light(&mut self, params: &Params) -> Result<Option<AreaLight>, LoadError> {
        let two_sided = params.switch("twosided", false)?;
        params.ignore(&["samples", "nsamples"]);
        // Version 3 has neither, and does not look at them
        let picture = if self.version_3 { None } else { params.text("filename")? };
        let power = self.photometric(params, "power")?;
        if picture.is_some() && params.get("L").is_some() {
            return Err(params.bad("an area light has either `L` or a `filename`"));
        }
        let mut radiance = self.light(params, "L")?;
        let (mut texture, mut mean) = (None, 1.0);
        if let Some(name) = picture {
            let (width, height, mut pixels) = self.linear_picture(params, name)?;
            pixels.iter_mut().flatten().for_each(|c| *c = c.max(0.0));
            mean = pixels.iter().map(|p| f64::from(luminance(*p))).sum::<f64>() / pixels.len() as f64;
            // Textures have values up to 1
            let peak = pixels.iter().flatten().fold(0.0f32, |peak, c| peak.max(*c));
            if peak > 0.0 {
                pixels.iter_mut().flatten().for_each(|c| *c /= peak);
            }
            radiance = radiance.map(|c| c * peak);
            let image = ImageTexture::new(width, height, Pixels::Float(pixels.into()));
            texture = Some(Texture::Image(ImageTexture { wrap: [Wrap::Clamp; 2], nearest: true, ..image }));
        }
        let emission = Emission { radiance, texture, two_sided };
        self.say_unused(params, "AreaLightSource");
        let sides = if two_sided { 2.0 } else { 1.0 };
        let power = power.map(|power| power / (mean * sides * PI));
        if power.is_some_and(|power| !power.is_finite()) {
            return Err(params.bad("`power` needs a picture that is not black"));
        }
        Ok((radiance != [0.0; 3]).then_some(AreaLight { emission, power }))
    }

    /// A power or an illuminance that a light is to have, as pbrt 4 has them; none unless it is above 0.
    fn photometric(&self, params: &Params, name: &str) -> Result<Option<f64>, LoadError> {
        if self.version_3 {
            return Ok(None);
        }
        Ok(params.float(name)?.filter(|asked| *asked > 0.0))
    }
}

fn times(by: f64, light: Rgb) -> Rgb {
    light.map(|c| (f64::from(c) * by) as f32)
}
