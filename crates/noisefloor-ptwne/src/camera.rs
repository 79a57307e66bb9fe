//! A pinhole camera.

use crate::error::SceneError;
use crate::math::{Ray, Vec3};

/// A pinhole camera. The aspect ratio follows from the resolution; pixels are square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position, in scene units.
    pub eye: [f32; 3],
    /// The point seen at the centre of the image.
    pub target: [f32; 3],
    /// A direction that points up in the image. It need not be perpendicular to the view, or have length 1.
    pub up: [f32; 3],
    /// Vertical field of view in degrees, above 0 and below 180.
    pub vertical_fov: f32,
}

impl Camera {
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        let all = [self.eye, self.target, self.up];
        if !all.iter().flatten().all(|x| x.is_finite()) || !self.vertical_fov.is_finite() {
            return Err(SceneError::NotFinite { what: "the camera" });
        }
        if !(self.vertical_fov > 0.0 && self.vertical_fov < 180.0) {
            let (what, range) = ("the vertical field of view", "0…180 degrees, both excluded");
            return Err(SceneError::Range { what, value: self.vertical_fov, range });
        }
        let view = (Vec3::from_array(self.target) - Vec3::from_array(self.eye)).normalize_or_zero();
        let across = view.cross(Vec3::from_array(self.up).normalize_or_zero());
        if across.length_squared() < 1e-10 { Err(SceneError::Camera) } else { Ok(()) }
    }

    /// The camera, prepared for an image of `width`×`height` pixels, in coordinates relative to `origin`.
    pub(crate) fn lens(&self, width: usize, height: usize, origin: Vec3) -> Lens {
        let eye = Vec3::from_array(self.eye);
        let view = (Vec3::from_array(self.target) - eye).normalize();
        let right = view.cross(Vec3::from_array(self.up)).normalize();
        let down = view.cross(right);
        // Height of a pixel on the plane one unit away
        let pixel = 2.0 * (0.5 * self.vertical_fov.to_radians()).tan() / height as f32;
        Lens {
            eye: eye - origin,
            corner: view - right * (0.5 * width as f32 * pixel) - down * (0.5 * height as f32 * pixel),
            right: right * pixel,
            down: down * pixel,
        }
    }
}

/// The image plane one unit in front of the eye.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lens {
    eye: Vec3,
    corner: Vec3,
    right: Vec3,
    down: Vec3,
}

impl Lens {
    /// The eye, and the inward normals of the four planes through it and the sides of a rectangle of pixels.
    pub(crate) fn pyramid(&self, x: [f32; 2], y: [f32; 2]) -> (Vec3, [Vec3; 4]) {
        let at = |x: f32, y: f32| self.corner + self.right * x + self.down * y;
        let corners = [at(x[0], y[0]), at(x[1], y[0]), at(x[1], y[1]), at(x[0], y[1])];
        let middle = at(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]));
        let normals = std::array::from_fn(|i| {
            let n = corners[i].cross(corners[(i + 1) % 4]).normalize_or_zero();
            if n.dot(middle) < 0.0 { -n } else { n }
        });
        (self.eye, normals)
    }

    /// The ray through (x, y), in pixels from the top left corner.
    #[inline]
    pub(crate) fn ray(&self, x: f32, y: f32) -> Ray {
        Ray { origin: self.eye, dir: (self.corner + self.right * x + self.down * y).normalize() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_the_image_is_the_target() {
        let camera = Camera {
            eye: [1.0, 2.0, 3.0],
            target: [4.0, 2.5, -1.0],
            up: [0.0, 2.0, 0.1],
            vertical_fov: 40.0,
        };
        camera.check().unwrap();
        let lens = camera.lens(320, 200, Vec3::ZERO);
        let view = (Vec3::new(4.0, 2.5, -1.0) - Vec3::new(1.0, 2.0, 3.0)).normalize();
        assert!((lens.ray(160.0, 100.0).dir - view).length() < 1e-6);
        // The top and bottom middles are one field of view apart, and the top is up
        let (top, bottom) = (lens.ray(160.0, 0.0).dir, lens.ray(160.0, 200.0).dir);
        assert!((top.angle_between(bottom).to_degrees() - 40.0).abs() < 1e-2);
        assert!(top.y > bottom.y);
        // Right of the middle is to the right: view × up
        assert!(lens.ray(320.0, 100.0).dir.dot(view.cross(Vec3::Y)) > 0.0);
    }

    #[test]
    fn cameras_that_look_nowhere_are_errors() {
        let good = Camera { eye: [0.0; 3], target: [0.0, 0.0, 1.0], up: [0.0, 1.0, 0.0], vertical_fov: 40.0 };
        assert_eq!(Camera { target: [0.0; 3], ..good }.check(), Err(SceneError::Camera));
        assert_eq!(Camera { up: [0.0, 0.0, -3.0], ..good }.check(), Err(SceneError::Camera));
        for vertical_fov in [0.0, -1.0, 180.0, f32::NAN] {
            assert!(Camera { vertical_fov, ..good }.check().is_err());
        }
    }
}
