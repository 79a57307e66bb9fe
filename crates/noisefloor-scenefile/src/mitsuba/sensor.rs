//! Camera, image size and path length.

use super::context::Context;
use super::xml::Element;
use crate::error::LoadError;
use crate::loaded::{anywhere, camera};
use glam::DMat3;
use noisefloor_ptwne::{Camera, FovAxis, Optics};

/// Mitsuba's image size where a scene gives none.
const DEFAULT_SIZE: (usize, usize) = (768, 576);
/// Largest width or height that is read, in pixels.
const MAX_EDGE: i64 = 1 << 16;

/// What is nearer to Mitsuba's cameras is not seen, unless they say otherwise.
const NEAR: f64 = 0.01;

/// Width and height of a picture and of the part of it that is shown, in pixels.
#[derive(Clone, Copy, Debug)]
struct FilmSize {
    whole: (usize, usize),
    shown: (usize, usize),
}

/// By default of scenes that are only checked.
pub(super) struct View {
    pub(super) camera: Camera,
    pub(super) optics: Optics,
    /// Image size in pixels.
    pub(super) size: Option<(usize, usize)>,
}

impl Default for View {
    fn default() -> Self {
        Self { camera: anywhere(), optics: Optics::default(), size: None }
    }
}

impl<'d> Context<'d> {
    /// The camera, and the image size that the scene asks for.
    pub(super) fn camera(&self, sensor: &'d Element) -> Result<View, LoadError> {
        let kind = sensor.kind();
        if !matches!(kind, "perspective" | "thinlens" | "orthographic") {
            return Err(self.unsupported_kind(sensor));
        }
        self.no_media(sensor)?;
        // Exporters write a far_clip beyond all that is there; a shutter moves nothing, and a sensor's
        // response is of spectra
        sensor.ignore(&["far_clip", "shutter_open", "shutter_close", "srf"]);
        sensor.children.iter().filter(|c| c.tag == "sampler").for_each(Element::irrelevant);
        let (size, mut window) = self.film_size(sensor)?;
        for (axis, name) in ["principal_point_offset_x", "principal_point_offset_y"].into_iter().enumerate() {
            let offset = self.float(sensor, name)?.unwrap_or(0.0);
            window[axis] = window[axis].map(|edge| edge + offset);
        }
        let to_world = self.transform(sensor, "to_world")?;
        let axes = DMat3::from_mat4(to_world);
        // Mitsuba's +x is to the left of the picture
        let mut optics = Optics {
            mirrored: axes.determinant() < 0.0,
            window: window.map(|edges| edges.map(|edge| edge as f32)),
            near: self.float(sensor, "near_clip")?.unwrap_or(NEAR) as f32,
            ..Optics::default()
        };
        let mut vertical_fov = 45.0;
        if kind == "orthographic" {
            // The picture is two units wide, scaled
            let (width, height) = size.map_or(DEFAULT_SIZE, |size| size.whole);
            let wide = 2.0 * axes.x_axis.length();
            optics.parallel_height = Some((wide * height as f64 / width as f64) as f32);
            sensor.ignore(&["focus_distance"]);
        } else {
            let (fov, axis) = self.field_of_view(sensor)?;
            (vertical_fov, optics.fov_axis) = (fov as f32, axis);
        }
        if kind == "thinlens" {
            let radius = self.float(sensor, "aperture_radius")?;
            let radius = radius.ok_or_else(|| self.bad(sensor, "a thin lens needs an `aperture_radius`"))?;
            optics.aperture_radius = radius as f32;
            optics.focus_distance = self.float(sensor, "focus_distance")?.unwrap_or(1e4) as f32;
        } else {
            sensor.ignore(&["focus_distance"]);
        }

        let size = size.map(|size| size.shown);
        Ok(View { camera: camera(to_world, vertical_fov), optics, size })
    }

    /// The size of the picture, and which part of it is shown: shares of its width and height.
    fn film_size(&self, sensor: &'d Element) -> Result<(Option<FilmSize>, [[f64; 2]; 2]), LoadError> {
        const WHOLE: [[f64; 2]; 2] = [[0.0, 1.0]; 2];
        let films = self.parts(sensor, "film")?;
        let Some(film) = films.first() else { return Ok((None, WHOLE)) };
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
        let pixels = |name: &str, least: i64, default: usize| match self.integer(film, name)? {
            None => Ok(default),
            Some(pixels) if (least..=MAX_EDGE).contains(&pixels) => Ok(pixels as usize),
            Some(_) => Err(self.bad(film, format!("`{name}` is not in {least}…{MAX_EDGE}"))),
        };
        let whole = (pixels("width", 1, DEFAULT_SIZE.0)?, pixels("height", 1, DEFAULT_SIZE.1)?);
        let (x, y) = (pixels("crop_offset_x", 0, 0)?, pixels("crop_offset_y", 0, 0)?);
        let shown = (
            pixels("crop_width", 1, whole.0.saturating_sub(x).max(1))?,
            pixels("crop_height", 1, whole.1.saturating_sub(y).max(1))?,
        );
        let share = |from: usize, size: usize, of: usize| [from, from + size].map(|at| at as f64 / of as f64);
        Ok((Some(FilmSize { whole, shown }), [share(x, shown.0, whole.0), share(y, shown.1, whole.1)]))
    }

    /// The field of view in degrees, and the edge that it spans.
    pub(super) fn field_of_view(&self, sensor: &'d Element) -> Result<(f64, FovAxis), LoadError> {
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
        let axis = match axis {
            "x" => FovAxis::Horizontal,
            "y" => FovAxis::Vertical,
            "diagonal" => FovAxis::Diagonal,
            "smaller" => FovAxis::Smaller,
            "larger" => FovAxis::Larger,
            other => {
                let what = format!("`fov_axis` is `{other}`; expected x, y, diagonal, smaller or larger");
                return Err(self.bad(sensor, what));
            }
        };
        Ok((fov, axis))
    }

    /// Whether the camera sees no emitters.
    pub(super) fn hides_emitters(&self, integrator: &'d Element) -> Result<bool, LoadError> {
        let own = self.boolean(integrator, "hide_emitters", false)?;
        match integrator.children.iter().find(|child| child.tag == "integrator") {
            Some(inner) => Ok(self.hides_emitters(inner)? || own),
            None => Ok(own),
        }
    }

    /// Longest path in segments, of what renders the scene in Mitsuba; none if it has no limit.
    pub(super) fn max_depth(&self, integrator: &'d Element) -> Result<Option<u32>, LoadError> {
        integrator.ignore(&["rr_depth"]);
        match integrator.kind() {
            "path" | "volpath" | "volpathmis" | "bdpt" => {}
            "direct" => {
                integrator.ignore(&["emitter_samples", "bsdf_samples", "shading_samples"]);
                return Ok(Some(2));
            }
            // Records more than light
            "aov" | "moment" | "stokes" => {
                integrator.irrelevant();
                if integrator.kind() == "stokes" {
                    self.approximated(integrator, "the polarisation of light is left out");
                }
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
