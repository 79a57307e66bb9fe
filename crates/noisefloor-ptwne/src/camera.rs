//! The camera.

use crate::checks::{MAX_COORDINATE, check_range};
use crate::error::SceneError;
use crate::math::{self, Ray, Vec3};
use serde::Serialize;

/// A camera, by default a pinhole. The aspect ratio follows from the resolution; pixels are square.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Camera {
    /// Position, in scene units.
    pub eye: [f32; 3],
    /// The point seen at the centre of the image.
    pub target: [f32; 3],
    /// A direction that points up in the image. It need not be perpendicular to the view, or have length 1.
    pub up: [f32; 3],
    /// Field of view in degrees, above 0 and below 180: vertical, unless [`Optics::fov_axis`] says otherwise.
    pub vertical_fov: f32,
}

/// Which edge of the image the field of view spans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FovAxis {
    /// From the bottom to the top.
    #[default]
    Vertical,
    /// From the left to the right.
    Horizontal,
    Smaller,
    Larger,
    /// From corner to corner.
    Diagonal,
}

/// How a [`Camera`] projects, besides its field of view. The default is a pinhole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// The edge that the field of view spans.
    pub fov_axis: FovAxis,
    /// Radius of the lens in scene units, 0…1e8; 0 has everything in focus.
    pub aperture_radius: f32,
    /// Distance of what is in focus, along the view, in scene units: above 0 if there is a lens.
    pub focus_distance: f32,
    /// For parallel projection: the height of what is seen, in scene units. The field of view and the lens do
    /// not count then.
    pub parallel_height: Option<f32>,
    /// Whether left and right are exchanged.
    pub mirrored: bool,
    /// The part of the picture that is shown, as shares of its width from the left and of its height from
    /// the top: −100…100. The field of view is that of the whole. [[0, 1], [0, 1]] is all of it.
    pub window: [[f32; 2]; 2],
    /// What is nearer along the view is not seen, in scene units, 0…1e8.
    pub near: f32,
    /// Whether the camera sees no light itself: its rays pass surfaces that shine, and find nothing around the scene.
    /// Mirrors, glass and all other surfaces see both.
    pub hides_lights: bool,
}

impl Default for Optics {
    fn default() -> Self {
        Self {
            fov_axis: FovAxis::default(),
            aperture_radius: 0.0,
            focus_distance: 0.0,
            parallel_height: None,
            mirrored: false,
            window: [[0.0, 1.0]; 2],
            near: 0.0,
            hides_lights: false,
        }
    }
}

impl Optics {
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        let all = [self.aperture_radius, self.focus_distance, self.parallel_height.unwrap_or(1.0)];
        if !all.iter().all(|x| x.is_finite()) {
            return Err(SceneError::NotFinite { what: "the optics of the camera" });
        }
        for [from, to] in self.window {
            let range = "-100…100, and rise";
            for edge in [from, to] {
                check_range("an edge of the camera's window", edge, [-100.0, 100.0], range)?;
            }
            check_range("the size of the camera's window", to - from, [1e-5, 200.0], "1e-5…200")?;
        }
        check_range("the nearest distance that is seen", self.near, [0.0, MAX_COORDINATE], "0…1e8")?;
        check_range("the radius of the lens", self.aperture_radius, [0.0, MAX_COORDINATE], "0…1e8")?;
        if self.aperture_radius > 0.0 {
            let (what, range) = ("the focus distance", "1e-6…1e9");
            check_range(what, self.focus_distance, [1e-6, 1e9], range)?;
        }
        let height = self.parallel_height.unwrap_or(1.0);
        check_range("the height of a parallel projection", height, [1e-6, MAX_COORDINATE], "1e-6…1e8")
    }
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
    pub(crate) fn lens(&self, optics: &Optics, width: usize, height: usize, origin: Vec3) -> Lens {
        let eye = Vec3::from_array(self.eye);
        let view = (Vec3::from_array(self.target) - eye).normalize();
        let side = view.cross(Vec3::from_array(self.up)).normalize();
        let down = view.cross(side);
        let right = if optics.mirrored { -side } else { side };

        // Size of the whole picture, and height of a pixel: on the plane one unit away, or in scene units
        let [[left, over], [top, under]] = optics.window;
        let (w, h) = (width as f32 / (over - left), height as f32 / (under - top));
        let span = match optics.fov_axis {
            FovAxis::Vertical => h,
            FovAxis::Horizontal => w,
            FovAxis::Smaller => w.min(h),
            FovAxis::Larger => w.max(h),
            FovAxis::Diagonal => w.hypot(h),
        };
        let pixel = match optics.parallel_height {
            Some(seen) => seen / h,
            None => 2.0 * (0.5 * self.vertical_fov.to_radians()).tan() / span,
        };
        let corner = -right * ((0.5 - left) * w * pixel) - down * ((0.5 - top) * h * pixel);
        let projection = match optics.parallel_height {
            Some(_) => Projection::Parallel { view },
            None if optics.aperture_radius > 0.0 => Projection::Thin {
                across: [side * optics.aperture_radius, down * optics.aperture_radius],
                focus: optics.focus_distance,
            },
            None => Projection::Pinhole,
        };
        let corner = if optics.parallel_height.is_some() { corner } else { corner + view };
        let near = view * optics.near;
        Lens { eye: eye - origin, corner, right: right * pixel, down: down * pixel, projection, near }
    }
}

/// The image plane: one unit in front of the eye, or through it under parallel projection.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lens {
    eye: Vec3,
    corner: Vec3,
    right: Vec3,
    down: Vec3,
    projection: Projection,
    /// From the eye to the nearest plane that is seen.
    near: Vec3,
}

#[derive(Clone, Copy, Debug)]
enum Projection {
    Pinhole,
    /// On a disk around the eye with these radii.
    Thin {
        across: [Vec3; 2],
        focus: f32,
    },
    /// All along `view`.
    Parallel {
        view: Vec3,
    },
}

impl Lens {
    /// The eye, and the inward normals of the four planes through it and the sides of a rectangle of pixels;
    /// none unless all rays begin at the eye.
    pub(crate) fn pyramid(&self, x: [f32; 2], y: [f32; 2]) -> Option<(Vec3, [Vec3; 4])> {
        let Projection::Pinhole = self.projection else { return None };
        let at = |x: f32, y: f32| self.corner + self.right * x + self.down * y;
        let corners = [at(x[0], y[0]), at(x[1], y[0]), at(x[1], y[1]), at(x[0], y[1])];
        let middle = at(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]));
        let normals = std::array::from_fn(|i| {
            let n = corners[i].cross(corners[(i + 1) % 4]).normalize_or_zero();
            if n.dot(middle) < 0.0 { -n } else { n }
        });
        Some((self.eye, normals))
    }

    /// The ray through (x, y), in pixels from the top left corner. `u` chooses a point of the lens.
    #[inline]
    pub(crate) fn ray(&self, x: f32, y: f32, u: [f32; 2]) -> Ray {
        let at = self.corner + self.right * x + self.down * y;
        let (origin, dir) = match self.projection {
            Projection::Pinhole => (self.eye, at.normalize()),
            Projection::Thin { across, focus } => {
                let [a, b] = math::disk(u);
                let offset = across[0] * a + across[1] * b;
                (self.eye + offset, (at * focus - offset).normalize())
            }
            Projection::Parallel { view } => (self.eye + at, view),
        };
        if self.near == Vec3::ZERO {
            return Ray { origin, dir };
        }
        // To the plane at that distance: near·near/(near·dir) along the ray
        let along = self.near.length_squared() / self.near.dot(dir).max(1e-12);
        Ray { origin: origin + dir * along, dir }
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
        let lens = camera.lens(&Optics::default(), 320, 200, Vec3::ZERO);
        let view = (Vec3::new(4.0, 2.5, -1.0) - Vec3::new(1.0, 2.0, 3.0)).normalize();
        assert!((lens.ray(160.0, 100.0, [0.5; 2]).dir - view).length() < 1e-6);
        // The top and bottom middles are one field of view apart, and the top is up
        let (top, bottom) = (lens.ray(160.0, 0.0, [0.5; 2]).dir, lens.ray(160.0, 200.0, [0.5; 2]).dir);
        assert!((top.angle_between(bottom).to_degrees() - 40.0).abs() < 1e-2);
        assert!(top.y > bottom.y);
        // Right of the middle is to the right: view × up
        assert!(lens.ray(320.0, 100.0, [0.5; 2]).dir.dot(view.cross(Vec3::Y)) > 0.0);
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

    fn straight() -> Camera {
        Camera { eye: [0.0; 3], target: [0.0, 0.0, -1.0], up: [0.0, 1.0, 0.0], vertical_fov: 90.0 }
    }

    /// The slope of the ray through the right edge of an image of 300×200 pixels is 1 where the field of view
    /// spans the width.
    #[test]
    fn fields_of_view_span_the_edge_they_name() {
        for (fov_axis, slope) in [
            (FovAxis::Vertical, 1.5),
            (FovAxis::Horizontal, 1.0),
            (FovAxis::Smaller, 1.5),
            (FovAxis::Larger, 1.0),
            (FovAxis::Diagonal, 1.5 / 1.5f32.hypot(1.0)),
        ] {
            for mirrored in [false, true] {
                let optics = Optics { fov_axis, mirrored, ..Optics::default() };
                let dir = straight().lens(&optics, 300, 200, Vec3::ZERO).ray(300.0, 100.0, [0.5; 2]).dir;
                let want = if mirrored { -slope } else { slope };
                assert!((dir.x / -dir.z - want).abs() < 1e-5, "{fov_axis:?} {dir}");
            }
        }
    }

    /// All rays of a pixel meet where it is in focus, from different points of the lens.
    #[test]
    fn lenses_focus() {
        let optics = Optics { aperture_radius: 0.5, focus_distance: 4.0, ..Optics::default() };
        let lens = straight().lens(&optics, 100, 100, Vec3::ZERO);
        for u in [[0.1, 0.2], [0.9, 0.7], [0.99, 0.4]] {
            let ray = lens.ray(75.0, 50.0, u);
            assert!(ray.origin.length() <= 0.5 && ray.origin.z.abs() < 1e-6);
            let at = ray.origin + ray.dir * ((-4.0 - ray.origin.z) / ray.dir.z);
            assert!((at - Vec3::new(2.0, 0.0, -4.0)).length() < 1e-5, "{at}");
        }
        assert!(lens.pyramid([0.0, 1.0], [0.0, 1.0]).is_none());
    }

    /// A window shows the pixels that the whole picture has there, and rays begin on the near plane.
    #[test]
    fn windows_are_parts_of_the_picture() {
        for parallel_height in [None, Some(3.0)] {
            let whole = Optics { fov_axis: FovAxis::Smaller, parallel_height, ..Optics::default() };
            let part = Optics { window: [[0.25, 0.75], [0.5, 1.0]], near: 2.0, ..whole };
            let (of_whole, of_part) =
                (straight().lens(&whole, 400, 200, Vec3::ZERO), straight().lens(&part, 200, 100, Vec3::ZERO));
            for [x, y] in [[0.0, 0.0], [200.0, 100.0], [30.0, 80.0]] {
                let (a, b) = (of_whole.ray(x + 100.0, y + 100.0, [0.5; 2]), of_part.ray(x, y, [0.5; 2]));
                assert!((a.dir - b.dir).length() < 1e-6);
                assert!((b.origin.z + 2.0).abs() < 1e-5, "{}", b.origin);
                let across = b.origin - a.origin;
                assert!((across - a.dir * across.dot(a.dir)).length() < 1e-5);
            }
        }
        for window in [[[0.5, 0.5], [0.0, 1.0]], [[0.0, f32::NAN], [0.0, 1.0]], [[0.0, 1.0], [0.0, 101.0]]] {
            assert!(Optics { window, ..Optics::default() }.check().is_err());
        }
    }

    #[test]
    fn parallel_rays_are_parallel() {
        let optics = Optics { parallel_height: Some(4.0), ..Optics::default() };
        let lens = straight().lens(&optics, 200, 100, Vec3::ZERO);
        let ray = lens.ray(200.0, 0.0, [0.5; 2]);
        assert!((ray.origin - Vec3::new(4.0, 2.0, 0.0)).length() < 1e-5 && ray.dir == Vec3::NEG_Z);
        for bad in [-1.0, f32::NAN, 0.0] {
            assert!(Optics { parallel_height: Some(bad), ..optics }.check().is_err());
        }
        assert!(Optics { aperture_radius: 1.0, ..Optics::default() }.check().is_err());
    }
}
