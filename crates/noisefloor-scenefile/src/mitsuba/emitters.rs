//! Emitters that are no shapes, and the light of those that are.

use super::context::Context;
use super::xml::Element;
use crate::channels::linear;
use crate::colour::Quantity;
use crate::error::LoadError;
use crate::mesh::{axes, rotation};
use crate::sky::{ClearSky, SUN_DIAMETER, TURBIDITIES};
use glam::{DMat3, DVec3};
use noisefloor::Rgb;
use noisefloor_ptwne::{
    Emission, Environment, EnvironmentMap, Falloff, FovAxis, ImageTexture, Profile, Punctual, SceneBuilder,
    Texture,
};

impl<'d> Context<'d> {
    /// Adds an emitter to the scene.
    pub(super) fn emitter(&self, element: &'d Element, builder: &mut SceneBuilder) -> Result<(), LoadError> {
        element.ignore(&["sampling_weight"]);
        let refused = self.refused(element);
        match element.kind() {
            "constant" => {
                let radiance = self.plain_light(element, "radiance")?;
                builder.environment(Environment::constant(radiance)).map_err(refused)?;
            }
            "envmap" => {
                builder.environment_map(self.environment_map(element)?).map_err(refused)?;
            }
            "sky" | "sun" | "sunsky" => {
                builder.environment_map(self.clear_sky(element)?).map_err(refused)?;
            }
            "point" => {
                let (position, _) = self.position_and_direction(element)?;
                let intensity = self.plain_light(element, "intensity")?;
                builder.punctual(Punctual::Point { position, intensity }).map_err(refused)?;
            }
            "spot" => self.spot(element, builder)?,
            "projector" => self.projector(element, builder)?,
            "directional" => {
                let (_, direction) = self.position_and_direction(element)?;
                let irradiance = self.plain_light(element, "irradiance")?;
                builder.punctual(Punctual::Distant { direction, irradiance }).map_err(refused)?;
            }
            "collimated" => {
                element.irrelevant();
                self.ignored(element, "the beam is ignored: it lights a single point");
            }
            // A definition for shapes that refer to it
            "area" if element.attribute("id").is_some() => element.irrelevant(),
            "area" => return Err(self.bad(element, "an area emitter belongs into a shape")),
            _ => return Err(self.unsupported_kind(element)),
        }
        Ok(())
    }

    /// The light of a shape, if it gives off any.
    ///
    /// An emitter of another kind is added to the scene: it shines by itself, whatever its shape.
    pub(super) fn emission(
        &self,
        shape: &'d Element,
        builder: &mut SceneBuilder,
    ) -> Result<Option<Emission>, LoadError> {
        let emitters = self.parts(shape, "emitter")?;
        let element = match emitters.as_slice() {
            [] => return Ok(None),
            [one] => one,
            [_, second, ..] => return Err(self.bad(second, "a shape has at most one emitter")),
        };
        element.ignore(&["sampling_weight"]);
        match element.kind() {
            "area" => {}
            "point" | "spot" | "projector" | "directional" | "collimated" => {
                self.emitter(element, builder)?;
                return Ok(None);
            }
            _ => return Err(self.unsupported(element, format!("{} in a shape", element.label()))),
        }
        let (radiance, texture) = self.light(element, "radiance")?;
        Ok(Some(Emission { radiance, texture, two_sided: false }))
    }

    /// Light that does not vary.
    pub(super) fn plain_light(&self, element: &'d Element, name: &str) -> Result<Rgb, LoadError> {
        match self.light(element, name)? {
            (light, None) => Ok(light),
            _ => Err(self.unsupported(element, format!("a texture as `{name}`"))),
        }
    }

    /// Where an emitter stands and where it shines to: by `to_world` from 0 along +z, or by `position` and
    /// `direction`.
    pub(super) fn position_and_direction(
        &self,
        element: &'d Element,
    ) -> Result<([f32; 3], [f32; 3]), LoadError> {
        let to_world = self.transform(element, "to_world")?;
        let position = self.point(element, "position")?.unwrap_or(to_world.w_axis.truncate());
        let direction = self.point(element, "direction")?.unwrap_or(to_world.z_axis.truncate());
        Ok((array(position), array(direction.normalize_or_zero())))
    }

    /// `sky`, `sun` or `sunsky`, of version 0.6, where +y is up, and of version 3, where +z is.
    fn clear_sky(&self, element: &'d Element) -> Result<EnvironmentMap, LoadError> {
        let number =
            |name: &str, missing: f64| Ok::<_, LoadError>(self.float(element, name)?.unwrap_or(missing));
        let scale = number("scale", 1.0)?;
        let [sky, sun] = [number("sky_scale", scale)?, number("sun_scale", scale)?];
        let scales = match element.kind() {
            "sky" => [sky, 0.0],
            "sun" => [0.0, sun],
            _ => [sky, sun],
        };
        let aperture = number("sun_aperture", SUN_DIAMETER)?;
        let sun_diameter = aperture * number("sun_radius_scale", 1.0)?;
        if scales.iter().any(|scale| *scale < 0.0) || !(0.0..=60.0).contains(&sun_diameter) {
            return Err(self.bad(element, "a scale is negative, or the sun is larger than 60 degrees"));
        }
        // Turned so that +z is up
        let up = if self.document.old {
            DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y)
        } else {
            DMat3::IDENTITY
        };
        let sky = ClearSky {
            sun: up * self.sun_direction(element)?,
            turbidity: number("turbidity", 3.0)?.clamp(*TURBIDITIES.start(), *TURBIDITIES.end()),
            albedo: self.constant_factor(element, "albedo", if self.document.old { 0.2 } else { 0.3 })?,
            scales,
            sun_diameter,
        };
        element.ignore(&["resolution", "sun_resolution"]);
        if scales[1] > 0.0 {
            self.approximated(element, "the sun is drawn into a map of the sky");
        }
        let [x, y, z] = axes(self.transform(element, "to_world")?);
        sky.map(DMat3::from_cols(x, y, z) * up.transpose()).map_err(|what| self.bad(element, what))
    }

    /// Towards the sun: `sun_direction`, or where it stands at a place and time.
    fn sun_direction(&self, element: &'d Element) -> Result<DVec3, LoadError> {
        let places =
            ["hour", "minute", "second", "day", "month", "year", "latitude", "longitude", "timezone"];
        let direction = self.point(element, "sun_direction")?;
        if let Some(direction) = direction {
            element.ignore(&places);
            return Ok(direction);
        }
        let number =
            |name: &str, missing: f64| Ok::<_, LoadError>(self.float(element, name)?.unwrap_or(missing));
        let day = number("day", 10.0)? + 30.6 * (number("month", 7.0)? - 1.0).max(0.0);
        let hour = number("hour", 15.0)? + number("minute", 0.0)? / 60.0 + number("second", 0.0)? / 3600.0;
        let [latitude, longitude] = [number("latitude", 35.6894)?, number("longitude", 139.6917)?];
        let timezone = number("timezone", 9.0)?;
        element.ignore(&["year"]);
        self.approximated(element, "the sun's place is computed to a degree or so");
        // Spencer's short formulas: declination, and the hour angle from the south westwards
        let declination = -23.44f64.to_radians() * (std::f64::consts::TAU * (day + 10.0) / 365.0).cos();
        let angle = (15.0 * (hour - 12.0 - timezone) + longitude).to_radians();
        let latitude = latitude.to_radians();
        let up = latitude.sin() * declination.sin() + latitude.cos() * declination.cos() * angle.cos();
        let west = declination.cos() * angle.sin();
        let south = latitude.sin() * declination.cos() * angle.cos() - latitude.cos() * declination.sin();
        // Mitsuba's axes: +x is east of a scene whose +z (0.6) or −y (3) is south
        Ok(if self.document.old { DVec3::new(-west, up, south) } else { DVec3::new(-west, -south, up) })
    }

    fn environment_map(&self, element: &'d Element) -> Result<EnvironmentMap, LoadError> {
        let name = self.string(element, "filename")?;
        let name = name.ok_or_else(|| self.bad(element, "an envmap needs a `filename`"))?;
        let ImageTexture { width, height, pixels, .. } = self.raster(element, name, false)?;
        let mut pixels = linear(&pixels);
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
            self.ignored(element, format!("{negative} values of the picture are negative and become 0"));
        }
        for pixel in &mut pixels {
            *pixel = pixel.map(|v| v.max(0.0) * scale);
        }

        // Directions; a mirrored map is a mirrored picture, turned
        let [mut x, y, z] = axes(self.transform(element, "to_world")?);
        if x.cross(y).dot(z) < 0.0 {
            x = -x;
            pixels.chunks_exact_mut(width).for_each(<[Rgb]>::reverse);
        }
        let to_world = rotation(DMat3::from_cols(x, y, z));
        let poles = !self.document.old;
        Ok(EnvironmentMap { width, height, pixels, to_world, poles })
    }
}

// Emitters without size that shine into a part of all directions.

impl<'d> Context<'d> {
    /// A `spot`, which may project a picture.
    pub(super) fn spot(&self, element: &'d Element, builder: &mut SceneBuilder) -> Result<(), LoadError> {
        let refused = self.refused(element);
        let (position, direction) = self.position_and_direction(element)?;
        let intensity = self.plain_light(element, "intensity")?;
        let outer = self.float(element, "cutoff_angle")?.unwrap_or(20.0);
        let inner = self.float(element, "beam_width")?.unwrap_or(0.75 * outer);
        // Equal angles mean a hard edge
        let (inner, outer) = (inner.min(0.9999 * outer) as f32, outer as f32);
        let falloff = Falloff::Linear;
        let textures = self.parts(element, "texture")?;
        let [texture] = textures.as_slice() else {
            let spot = Punctual::Spot { position, direction, intensity, inner, outer, falloff };
            return builder.punctual(spot).map_err(refused);
        };
        // The picture spans the cone
        let (peak, picture) = self.picture(texture)?;
        let [x, y, z] = axes(self.transform(element, "to_world")?).map(array);
        let profile = Profile::Spot { inner, outer, falloff };
        let extent = [outer.to_radians().tan(); 2];
        let intensity = intensity.map(|c| c * peak);
        // Mitsuba's v counts from the top of a picture
        let axes = [x, y.map(|c| -c), z];
        builder
            .projector(Punctual::Projector { position, axes, extent, intensity, profile }, picture)
            .map_err(refused)
    }

    /// A `projector`: a perspective camera the other way round, whose picture is the irradiance of a plane one unit
    /// away, over π.
    pub(super) fn projector(
        &self,
        element: &'d Element,
        builder: &mut SceneBuilder,
    ) -> Result<(), LoadError> {
        let (position, _) = self.position_and_direction(element)?;
        let scale = self.float(element, "scale")?.unwrap_or(1.0) as f32;
        let (light, picture) = self.light(element, "irradiance")?;
        let aspect = match &picture {
            Some(Texture::Image(image)) => image.width as f64 / image.height as f64,
            _ => 1.0,
        };
        let wide = self.half_width(element, aspect)?;
        let extent = [wide as f32, (wide / aspect) as f32];
        let intensity = light.map(|c| c * scale * std::f32::consts::PI);
        // The picture's u runs along −x, as that of a camera does
        let [x, y, z] = axes(self.transform(element, "to_world")?).map(array);
        let axes = [x.map(|c| -c), y, z];
        let profile = Profile::EvenPlane;
        let projector = Punctual::Projector { position, axes, extent, intensity, profile };
        let picture = picture.unwrap_or(Texture::Colour([1.0; 3]));
        builder.projector(projector, picture).map_err(self.refused(element))
    }

    /// A picture as light, and what to multiply it with.
    fn picture(&self, texture: &'d Element) -> Result<(f32, Texture), LoadError> {
        let (peak, picture) = self.image(texture, Quantity::Light)?;
        Ok((peak, self.varying(texture, picture)?))
    }

    /// Tangent of half the angle that a picture of width over height `aspect` covers sideways.
    fn half_width(&self, element: &'d Element, aspect: f64) -> Result<f64, LoadError> {
        let (fov, axis) = self.field_of_view(element)?;
        let half = (0.5 * fov.to_radians()).tan();
        Ok(match axis {
            FovAxis::Vertical => half * aspect,
            FovAxis::Smaller => half * aspect.max(1.0),
            FovAxis::Larger => half * aspect.min(1.0),
            FovAxis::Diagonal => half * aspect / aspect.hypot(1.0),
            _ => half,
        })
    }
}

fn array(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}
