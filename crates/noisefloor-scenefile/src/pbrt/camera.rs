//! What looks at the scene.

use super::params::Params;
use crate::error::LoadError;
use crate::loaded::camera;
use glam::{DMat3, DMat4};
use noisefloor_ptwne::{Camera, FovAxis, Optics};

/// Largest width or height that is read, in pixels.
const MAX_EDGE: u64 = 1 << 16;

#[derive(Clone, Debug)]
pub(super) struct View {
    /// From the camera, which looks along +z with +y up and +x to the right, to the world.
    to_world: DMat4,
    fov: f64,
    lens_radius: f64,
    focus: f64,
    /// Half of the shorter edge of a parallel projection.
    parallel: Option<f64>,
    size: (usize, usize),
    /// The part of the picture that is shown, in shares: from the left and right, top and bottom.
    window: [[f64; 2]; 2],
    /// Factor on all light.
    pub(super) exposure: f32,
    /// Largest channel of a sample.
    pub(super) clamp: Option<f32>,
}

impl Default for View {
    fn default() -> Self {
        Self {
            to_world: DMat4::IDENTITY,
            fov: 90.0,
            lens_radius: 0.0,
            focus: 1e6,
            parallel: None,
            size: (1280, 720),
            window: [[0.0, 1.0]; 2],
            exposure: 1.0,
            clamp: None,
        }
    }
}

impl View {
    /// Reads a `Camera`; `from_world` is the transform there.
    pub(super) fn camera(&mut self, kind: &str, params: &Params, from_world: DMat4) -> Result<(), LoadError> {
        params.ignore(&["shutteropen", "shutterclose"]);
        match kind {
            "perspective" => {
                self.fov = params.float("fov")?.unwrap_or(90.0);
                if let Some(half) = params.float("halffov")? {
                    self.fov = 2.0 * half;
                }
                if !(self.fov > 0.0 && self.fov < 180.0) {
                    return Err(params.bad(format!("`fov` is {}, not between 0 and 180 degrees", self.fov)));
                }
            }
            "orthographic" => self.parallel = Some(1.0),
            _ => return Err(params.place.unsupported(format!("Camera \"{kind}\""))),
        }
        if let Some(window) = params.numbers("screenwindow")? {
            match window {
                // As wide on both sides: another angle
                [left, right, bottom, top] if left + right == 0.0 && bottom + top == 0.0 && *top > 0.0 => {
                    let half = right.min(*top);
                    self.fov = 2.0 * ((0.5 * self.fov.to_radians()).tan() * half).atan().to_degrees();
                    self.parallel = self.parallel.map(|_| half);
                }
                _ => return Err(params.place.unsupported("a `screenwindow` aside of the middle")),
            }
        }
        self.lens_radius = params.float("lensradius")?.unwrap_or(0.0);
        self.focus = params.float("focaldistance")?.unwrap_or(1e6);
        if from_world.determinant() == 0.0 {
            return Err(params.bad("the transform of the camera cannot be inverted"));
        }
        self.to_world = from_world.inverse();
        Ok(())
    }

    pub(super) fn film(&mut self, params: &Params) -> Result<(), LoadError> {
        let edge = |name: &str, missing: usize| match params.count(name)? {
            None => Ok(missing),
            Some(edge @ 1..=MAX_EDGE) => Ok(edge as usize),
            Some(_) => Err(params.bad(format!("`{name}` is not in 1…{MAX_EDGE}"))),
        };
        self.size = (edge("xresolution", self.size.0)?, edge("yresolution", self.size.1)?);
        self.window = self.crop(params)?;
        if let Some(most) = params.float("maxcomponentvalue")? {
            let most = Some(most as f32).filter(|most| *most > 0.0 && most.is_finite());
            self.clamp = Some(most.ok_or_else(|| params.bad("`maxcomponentvalue` must be above 0"))?);
        }
        // pbrt 3 has a factor, pbrt 4 a sensor
        let scale = params.float("scale")?.unwrap_or(1.0);
        let exposure =
            params.float("exposuretime")?.unwrap_or(1.0) * params.float("iso")?.unwrap_or(100.0) / 100.0;
        self.exposure = (scale * exposure) as f32;
        if !(self.exposure >= 0.0 && self.exposure.is_finite()) {
            return Err(params.bad("the exposure of the film is negative or too large"));
        }
        Ok(())
    }

    /// The part of the picture that is shown: `cropwindow` in shares, or `pixelbounds`.
    fn crop(&self, params: &Params) -> Result<[[f64; 2]; 2], LoadError> {
        let sizes = [self.size.0 as f64, self.size.1 as f64];
        let (edges, units) = match (params.numbers("cropwindow")?, params.numbers("pixelbounds")?) {
            (None, None) => return Ok([[0.0, 1.0]; 2]),
            (Some([a, b, c, d]), _) => ([[*a, *b], [*c, *d]], sizes),
            (None, Some([a, b, c, d])) => ([[*a, *b], [*c, *d]], [1.0; 2]),
            _ => return Err(params.bad("a part of the picture has four numbers")),
        };
        let mut window = [[0.0, 1.0]; 2];
        for axis in 0..2 {
            // Whole pixels, as pbrt rounds
            window[axis] =
                edges[axis].map(|edge| (edge * units[axis]).clamp(0.0, sizes[axis]).ceil() / sizes[axis]);
            if window[axis][0] >= window[axis][1] {
                return Err(params.bad("a part of the picture is empty"));
            }
        }
        Ok(window)
    }

    /// Image size in pixels, of the part that is shown.
    pub(super) fn size(&self) -> (usize, usize) {
        let [x, y] = self.window.map(|[from, to]| to - from);
        let part = |share: f64, size: usize| ((share * size as f64).round() as usize).max(1);
        (part(x, self.size.0), part(y, self.size.1))
    }

    pub(super) fn to_camera(&self) -> Camera {
        camera(self.to_world, self.fov as f32)
    }

    pub(super) fn optics(&self) -> Optics {
        let axes = DMat3::from_mat4(self.to_world);
        let (width, height) = (self.size.0 as f64, self.size.1 as f64);
        let scale = axes.y_axis.length();
        Optics {
            fov_axis: FovAxis::Smaller,
            aperture_radius: (self.lens_radius * scale) as f32,
            focus_distance: (self.focus * scale) as f32,
            parallel_height: self
                .parallel
                .map(|half| (2.0 * half * scale * (height / width).max(1.0)) as f32),
            // Its +x is to the right, where a camera of ours has view × up = −x
            mirrored: axes.determinant() > 0.0,
            window: self.window.map(|edges| edges.map(|edge| edge as f32)),
            ..Optics::default()
        }
    }
}
