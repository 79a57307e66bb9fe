//! Camera, image size and path length.

use super::context::Context;
use super::xml::Element;
use crate::error::LoadError;
use glam::{DMat3, DVec3};
use noisefloor_ptwne::Camera;

/// Mitsuba's image size where a scene gives none.
const DEFAULT_SIZE: (usize, usize) = (768, 576);
/// Largest width or height that is read, in pixels.
const MAX_EDGE: i64 = 1 << 16;

/// A camera for scenes that are only checked.
pub(super) fn anywhere() -> Camera {
    Camera { eye: [0.0; 3], target: [0.0, 0.0, 1.0], up: [0.0, 1.0, 0.0], vertical_fov: 45.0 }
}

impl<'d> Context<'d> {
    /// The camera, and the image size that the scene asks for.
    pub(super) fn camera(&self, sensor: &'d Element) -> Result<(Camera, Option<(usize, usize)>), LoadError> {
        match sensor.kind() {
            "perspective" => {}
            "thinlens" => {
                self.approximated(sensor, "the lens is replaced by a pinhole: everything is in focus");
                sensor.ignore(&["aperture_radius", "focus_distance"]);
            }
            _ => return Err(self.unsupported(sensor, sensor.species())),
        }
        self.no_media(sensor)?;
        sensor.ignore(&["near_clip", "far_clip", "shutter_open", "shutter_close", "srf"]);
        sensor.children.iter().filter(|c| c.tag == "sampler").for_each(Element::irrelevant);
        let size = self.film_size(sensor)?;
        let (width, height) = size.unwrap_or(DEFAULT_SIZE);
        let vertical_fov = self.vertical_fov(sensor, width as f64, height as f64)? as f32;

        let to_world = self.transform(sensor, "to_world")?;
        let axes = DMat3::from_mat4(to_world);
        if axes.determinant() < 0.0 {
            return Err(
                self.unsupported(sensor, "a mirrored camera (its `to_world` has a negative determinant)")
            );
        }
        let (eye, view) = (to_world.w_axis.truncate(), axes.z_axis.normalize_or_zero());
        // Far from 0, a target close by would be rounded
        let target = eye + view * eye.abs().max_element().max(1.0);
        let array = |v: DVec3| v.as_vec3().to_array();
        let up = array(axes.y_axis.normalize_or_zero());
        Ok((Camera { eye: array(eye), target: array(target), up, vertical_fov }, size))
    }

    fn film_size(&self, sensor: &'d Element) -> Result<Option<(usize, usize)>, LoadError> {
        let films = self.parts(sensor, "film")?;
        let Some(film) = films.first() else { return Ok(None) };
        film.children.iter().filter(|c| c.tag == "rfilter").for_each(Element::irrelevant);
        // How the image is stored
        film.ignore(&[
            "pixel_format",
            "component_format",
            "file_format",
            "high_quality_edges",
            "sample_border",
            "banner",
        ]);
        let edge = |name: &str, default: usize| match self.integer(film, name)? {
            None => Ok(default),
            Some(edge @ 1..=MAX_EDGE) => Ok(edge as usize),
            Some(_) => Err(self.bad(film, format!("`{name}` is not in 1…{MAX_EDGE}"))),
        };
        Ok(Some((edge("width", DEFAULT_SIZE.0)?, edge("height", DEFAULT_SIZE.1)?)))
    }

    /// In degrees.
    fn vertical_fov(&self, sensor: &'d Element, width: f64, height: f64) -> Result<f64, LoadError> {
        let axis = self.string(sensor, "fov_axis")?.unwrap_or("x");
        let (fov, axis) = match (self.float(sensor, "fov")?, self.string(sensor, "focal_length")?) {
            (Some(fov), _) => (fov, axis),
            // Of a frame of 36 mm × 24 mm
            (None, length) => {
                let length = length.unwrap_or("50mm").trim().trim_end_matches("mm");
                let length = length.parse().ok().filter(|length: &f64| *length > 0.0 && length.is_finite());
                let length =
                    length.ok_or_else(|| self.bad(sensor, "`focal_length` is not a length in mm"))?;
                ((2.0 * (36f64.hypot(24.0) / (2.0 * length)).atan()).to_degrees(), "diagonal")
            }
        };
        if !(fov > 0.0 && fov < 180.0) {
            return Err(self.bad(sensor, format!("`fov` is {fov}; it must be above 0 and below 180 degrees")));
        }
        let across = match axis {
            "x" => width,
            "y" => height,
            "diagonal" => width.hypot(height),
            "smaller" => width.min(height),
            "larger" => width.max(height),
            other => {
                return Err(self.bad(
                    sensor,
                    format!("`fov_axis` is `{other}`; expected x, y, diagonal, smaller or larger"),
                ));
            }
        };
        let slope = (0.5 * fov.to_radians()).tan() * height / across;
        Ok(2.0 * slope.atan().to_degrees())
    }

    /// Longest path in segments, of what renders the scene in Mitsuba; none if it has no limit.
    pub(super) fn max_depth(&self, integrator: &'d Element) -> Result<Option<u32>, LoadError> {
        integrator.ignore(&["rr_depth"]);
        if self.boolean(integrator, "hide_emitters", false)? {
            self.ignored(integrator, "`hide_emitters` is ignored: emitters are seen");
        }
        match integrator.kind() {
            "path" | "volpath" | "volpathmis" | "bdpt" => {}
            "direct" => {
                integrator.ignore(&["emitter_samples", "bsdf_samples", "shading_samples"]);
                return Ok(Some(2));
            }
            // Records more than light
            "aov" | "moment" => {
                integrator.irrelevant();
                return match integrator.children.iter().find(|child| child.tag == "integrator") {
                    Some(inner) => self.max_depth(inner),
                    None => Ok(None),
                };
            }
            other => {
                self.approximated(integrator, format!("the integrator `{other}` is replaced by path tracing"))
            }
        }
        match self.integer(integrator, "max_depth")? {
            None | Some(-1) => Ok(None),
            Some(depth) => match u32::try_from(depth) {
                Ok(depth @ 1..) => Ok(Some(depth)),
                _ => {
                    Err(self.bad(integrator, format!("`max_depth` is {depth}; it must be −1 or at least 1")))
                }
            },
        }
    }
}
