//! Emitters that are no shapes, and the light of those that are.

use super::context::Context;
use super::xml::Element;
use crate::error::LoadError;
use glam::{DMat3, DVec3};
use noisefloor::Rgb;
use noisefloor_ptwne::{Emission, Environment, EnvironmentMap, Punctual, SceneBuilder};

impl<'d> Context<'d> {
    /// Adds an emitter to the scene. The result is whether it surrounds the scene.
    pub(super) fn emitter(
        &self,
        element: &'d Element,
        builder: &mut SceneBuilder,
    ) -> Result<bool, LoadError> {
        element.ignore(&["sampling_weight"]);
        let refused = self.refused(element);
        match element.kind() {
            "constant" => {
                let radiance = self.plain_light(element, "radiance")?;
                builder.environment(Environment::constant(radiance)).map_err(refused)?;
                return Ok(true);
            }
            "envmap" => {
                builder.environment_map(self.environment_map(element)?).map_err(refused)?;
                return Ok(true);
            }
            "point" => {
                let (position, _) = self.position_and_direction(element)?;
                let intensity = self.plain_light(element, "intensity")?;
                builder.punctual(Punctual::Point { position, intensity }).map_err(refused)?;
            }
            "spot" => {
                let (position, direction) = self.position_and_direction(element)?;
                let intensity = self.plain_light(element, "intensity")?;
                let outer = self.float(element, "cutoff_angle")?.unwrap_or(20.0);
                let inner = self.float(element, "beam_width")?.unwrap_or(0.75 * outer);
                self.warn(element, "the spot fades towards its edge as those of glTF do");
                let (inner, outer) = (inner as f32, outer as f32);
                let spot = Punctual::Spot { position, direction, intensity, inner, outer };
                builder.punctual(spot).map_err(refused)?;
            }
            "directional" => {
                let (_, direction) = self.position_and_direction(element)?;
                let irradiance = self.plain_light(element, "irradiance")?;
                builder.punctual(Punctual::Distant { direction, irradiance }).map_err(refused)?;
            }
            "area" => return Err(self.bad(element, "an area emitter belongs into a shape")),
            _ => return Err(self.unsupported(element, element.label())),
        }
        Ok(false)
    }

    /// The light of a shape, if it gives off any.
    pub(super) fn emission(&self, shape: &'d Element) -> Result<Option<Emission>, LoadError> {
        let emitters = self.parts(shape, "emitter")?;
        let element = match emitters.as_slice() {
            [] => return Ok(None),
            [one] => one,
            [_, second, ..] => return Err(self.bad(second, "a shape has at most one emitter")),
        };
        element.ignore(&["sampling_weight"]);
        if element.kind() != "area" {
            return Err(self.unsupported(element, format!("{} in a shape", element.label())));
        }
        let (radiance, texture) = self.light(element, "radiance")?;
        Ok(Some(Emission { radiance, texture, two_sided: false }))
    }

    /// Light that does not vary.
    fn plain_light(&self, element: &'d Element, name: &str) -> Result<Rgb, LoadError> {
        match self.light(element, name)? {
            (light, None) => Ok(light),
            _ => Err(self.unsupported(element, format!("a texture as `{name}`"))),
        }
    }

    /// Where an emitter stands and where it shines to: by `to_world` from 0 along +z, or by `position` and
    /// `direction`.
    fn position_and_direction(&self, element: &'d Element) -> Result<([f32; 3], [f32; 3]), LoadError> {
        let to_world = self.transform(element, "to_world")?;
        let position = self.point(element, "position")?.unwrap_or(to_world.w_axis.truncate());
        let direction = self.point(element, "direction")?.unwrap_or(to_world.z_axis.truncate());
        Ok((position.as_vec3().to_array(), direction.normalize_or_zero().as_vec3().to_array()))
    }

    fn environment_map(&self, element: &'d Element) -> Result<EnvironmentMap, LoadError> {
        let name = self.string(element, "filename")?;
        let name = name.ok_or_else(|| self.bad(element, "an envmap needs a `filename`"))?;
        let raster = self.raster(element, name, false)?;
        let (width, height, mut pixels) = raster.linear();
        self.count_pixels(element, pixels.len())?;

        // Brightness
        let scale = self.float(element, "scale")?.unwrap_or(1.0) as f32;
        if scale < 0.0 {
            return Err(self.bad(element, "`scale` is negative"));
        }
        if !pixels.iter().flatten().all(|v| v.is_finite()) {
            return Err(self.bad(element, "the picture has values that are not finite"));
        }
        let negative = pixels.iter().flatten().filter(|v| **v < 0.0).count();
        if negative > 0 {
            self.warn(element, format!("{negative} values of the picture are negative and become 0"));
        }
        for pixel in &mut pixels {
            *pixel = pixel.map(|v| v.max(0.0) * scale);
        }

        // Directions; a mirrored map is a mirrored picture, turned
        let matrix = DMat3::from_mat4(self.transform(element, "to_world")?);
        let mut axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec3::normalize_or_zero);
        if axes[0].cross(axes[1]).dot(axes[2]) < 0.0 {
            axes[0] = -axes[0];
            pixels.chunks_exact_mut(width).for_each(<[Rgb]>::reverse);
        }
        let [x, y, z] = axes.map(|axis| axis.as_vec3());
        let to_world = [[x.x, y.x, z.x], [x.y, y.y, z.y], [x.z, y.z, z.z]];
        Ok(EnvironmentMap { width, height, pixels, to_world })
    }
}
