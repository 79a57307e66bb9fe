//! Emitters without size that shine into a part of all directions.

use super::context::Context;
use super::xml::Element;
use crate::colour::Quantity;
use crate::error::LoadError;
use glam::DMat3;
use noisefloor_ptwne::{Falloff, FovAxis, Profile, Punctual, SceneBuilder, Texture};

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
        let [x, y, z] = self.axes(element)?;
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
        let [x, y, z] = self.axes(element)?;
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

    /// The directions of x, y and z of an emitter.
    fn axes(&self, element: &'d Element) -> Result<[[f32; 3]; 3], LoadError> {
        let matrix = DMat3::from_mat4(self.transform(element, "to_world")?);
        let axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
        Ok(axes.map(|axis| axis.normalize_or_zero().as_vec3().to_array()))
    }
}
