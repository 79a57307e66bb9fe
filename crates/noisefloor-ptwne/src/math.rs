//! Vectors, and the classic mappings of the unit square. Directions have length 1; angles are in radians.

use std::f32::consts::{FRAC_1_PI, PI};

/// Positions, directions and RGB.
pub(crate) type Vec3 = glam::Vec3A;

/// Stands for the density of a direction that no other technique can sample: mirrors, glass, camera rays.
pub(crate) const DELTA: f32 = f32::INFINITY;

/// A ray; `dir` has length 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    pub(crate) origin: Vec3,
    pub(crate) dir: Vec3,
}

/// An orthonormal frame around a normal (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) x: Vec3,
    pub(crate) y: Vec3,
    pub(crate) z: Vec3,
}

impl Frame {
    #[inline]
    pub(crate) fn new(n: Vec3) -> Self {
        let sign = 1f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            x: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            y: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            z: n,
        }
    }

    /// With x along `tangent`, as far as it is perpendicular to `n`; any x if it is not.
    #[inline]
    pub(crate) fn along(n: Vec3, tangent: Vec3) -> Self {
        match (tangent - n * n.dot(tangent)).try_normalize() {
            Some(x) => Self { x, y: n.cross(x), z: n },
            None => Self::new(n),
        }
    }

    #[inline]
    pub(crate) fn to_world(self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    #[inline]
    pub(crate) fn to_local(self, v: Vec3) -> Vec3 {
        Vec3::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }
}

/// The largest integer not above `x`. The library's is a function call without SSE4.1.
#[inline]
pub(crate) fn floor(x: f32) -> f32 {
    // All numbers from 2²³ on are integers
    if x.abs() < 8_388_608.0 {
        let towards_zero = x as i32 as f32;
        if towards_zero > x { towards_zero - 1.0 } else { towards_zero }
    } else {
        x
    }
}

/// Sine and cosine of 2π·u for u in [0, 1]: polynomials after folding to an eighth of a turn, with an
/// absolute error below 1e-6. The library's are accurate to the last bit and three times slower.
#[inline]
pub(crate) fn turn(u: f32) -> (f32, f32) {
    // Fold to x ∈ [−1/8, 1/8] of a turn and a quadrant
    let quadrant = (u * 4.0 + 0.5) as i32;
    let x = (u - quadrant as f32 * 0.25) * (2.0 * PI);
    let x2 = x * x;
    // Taylor series; the first terms left out are x⁹/9! < 4e-7 and x¹⁰/10! < 3e-8
    let sin = x * (1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0))));
    let cos = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 * (1.0 / 40320.0))));
    match quadrant & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// A direction of the upper hemisphere, with density cos θ / π (Malley's method).
#[inline]
pub(crate) fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let (sin, cos) = turn(u[1]);
    let r = u[0].sqrt();
    Vec3::new(r * cos, r * sin, (1.0 - u[0]).sqrt())
}

/// A point of the unit disk, uniform in area.
#[inline]
pub(crate) fn disk(u: [f32; 2]) -> [f32; 2] {
    let (sin, cos) = turn(u[1]);
    let r = u[0].sqrt();
    [r * cos, r * sin]
}

/// A direction of the unit sphere, with density 1 / 4π.
#[inline]
pub(crate) fn sphere(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = turn(u[1]);
    Vec3::new(r * cos, r * sin, z)
}

/// A direction of the cone around +z with 1 − cos θ = `one_minus_cos` for its half angle θ, uniform in solid
/// angle. Written with 1 − cos θ since cos θ of a narrow cone rounds to 1.
#[inline]
pub(crate) fn cone(one_minus_cos: f32, u: [f32; 2]) -> Vec3 {
    let m = u[0] * one_minus_cos;
    let r = (m * (2.0 - m)).max(0.0).sqrt();
    let (sin, cos) = turn(u[1]);
    Vec3::new(r * cos, r * sin, 1.0 - m)
}

/// Density of [`cone`].
#[inline]
pub(crate) fn cone_pdf(one_minus_cos: f32) -> f32 {
    0.5 * FRAC_1_PI / one_minus_cos
}

/// `dir`, mirrored by a surface with normal `n`.
#[inline]
pub(crate) fn reflect(dir: Vec3, n: Vec3) -> Vec3 {
    dir - n * (2.0 * dir.dot(n))
}

/// Luminance of linear Rec.709 RGB.
#[inline]
pub(crate) fn luminance(c: Vec3) -> f32 {
    c.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Power heuristic with exponent 2 (Veach 1997, §9.2.4): the weight of a sample of density `a` that another
/// technique takes with density `b`. Written so that no square overflows.
#[inline]
pub(crate) fn power_heuristic(a: f32, b: f32) -> f32 {
    if a >= b {
        let r = b / a;
        1.0 / (1.0 + r * r)
    } else {
        let r = a / b;
        r * r / (1.0 + r * r)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_floor_is_that_of_the_library() {
        let numbers = [
            0.0,
            -0.0,
            0.5,
            -0.5,
            1.0,
            -1.0,
            8_388_607.5,
            -8_388_607.5,
            8_388_608.0,
            1e30,
            -1e30,
            1e-40,
            -1e-40,
        ];
        for x in numbers.into_iter().chain((0..1000).map(|i| (i as f32 - 500.0) * 0.37)) {
            assert_eq!(floor(x), x.floor(), "{x}");
        }
        assert!(floor(f32::NAN).is_nan() && floor(f32::INFINITY).is_infinite());
    }

    #[test]
    fn turn_is_sine_and_cosine() {
        for i in 0..=100_000 {
            let u = i as f32 / 100_000.0;
            let (sin, cos) = turn(u);
            let exact = f64::from(u) * std::f64::consts::TAU;
            assert!((f64::from(sin) - exact.sin()).abs() < 1e-6, "{u}");
            assert!((f64::from(cos) - exact.cos()).abs() < 1e-6, "{u}");
        }
    }

    #[test]
    fn frames_are_orthonormal() {
        for i in 0..1000 {
            let n = sphere([i as f32 / 1000.0, (i * 7 % 1000) as f32 / 1000.0]).normalize();
            let f = Frame::new(n);
            for (a, b) in [(f.x, f.y), (f.y, f.z), (f.z, f.x)] {
                assert!(a.dot(b).abs() < 1e-5);
                assert!((a.length() - 1.0).abs() < 1e-5);
            }
            assert!((f.to_local(f.to_world(Vec3::X)) - Vec3::X).length() < 1e-5);
        }
    }

    #[test]
    fn heuristics_sum_to_one() {
        for (a, b) in [(1.0, 3.0), (1e30, 1e-30), (1e30, 1e30), (0.0, 1.0)] {
            assert!((power_heuristic(a, b) + power_heuristic(b, a) - 1.0).abs() < 1e-6);
        }
        assert_eq!(power_heuristic(f32::INFINITY, 1.0), 1.0);
    }
}
