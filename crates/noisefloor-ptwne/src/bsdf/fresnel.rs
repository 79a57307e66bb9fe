//! Fresnel's equations, and Snell's law.

use crate::math::Vec3;

/// Schlick's approximation of the Fresnel term (Schlick 1994) for reflectance `f0` at normal incidence.
#[inline]
pub(crate) fn schlick(f0: Vec3, cos: f32) -> Vec3 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    let m2 = m * m;
    f0 + (Vec3::ONE - f0) * (m2 * m2 * m)
}

/// Unpolarised Fresnel reflectance of a dielectric at `cos_i` ≥ 0, and the cosine of the refracted direction.
/// `eta` is the index of refraction on the far side over that on the near side. (1, 0) is total internal
/// reflection.
#[inline]
pub(crate) fn fresnel(cos_i: f32, eta: f32) -> (f32, f32) {
    let sin2_t = (1.0 - cos_i * cos_i).max(0.0) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t)
}

/// Unpolarised reflectance of a conductor with index of refraction η + ik at `cos` ≥ 0 (Born, Wolf 1999,
/// §14.2, written without complex numbers).
#[inline]
pub(crate) fn fresnel_complex(eta: Vec3, k: Vec3, cos: f32) -> Vec3 {
    let (cos2, sin2) = (cos * cos, (1.0 - cos * cos).max(0.0));
    let t = eta * eta - k * k - Vec3::splat(sin2);
    // a² + b² and a, of √((η + ik)² − sin²) = a + ib
    let sum = (t * t + 4.0 * eta * eta * k * k).map(f32::sqrt);
    let a = (0.5 * (sum + t)).max(Vec3::ZERO).map(f32::sqrt);
    let (x, y) = (sum + Vec3::splat(cos2), 2.0 * cos * a);
    let perpendicular = (x - y) / (x + y);
    let (x, y) = (cos2 * sum + Vec3::splat(sin2 * sin2), y * sin2);
    0.5 * perpendicular * (Vec3::ONE + (x - y) / (x + y))
}

/// The Fresnel term of a surface that lets no light in.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Fresnel {
    /// One: a perfect mirror.
    None,
    /// Schlick's; the colour is the reflectance at normal incidence.
    Schlick,
    /// That of a conductor; the colour is a factor.
    Complex { eta: Vec3, k: Vec3 },
}

impl Fresnel {
    #[inline]
    pub(crate) fn at(&self, colour: Vec3, cos: f32) -> Vec3 {
        match *self {
            Self::None => colour,
            Self::Schlick => schlick(colour, cos),
            Self::Complex { eta, k } => colour * fresnel_complex(eta, k, cos),
        }
    }
}

/// Reflectance of a thin pane, all reflections between its boundaries included. The rest is transmitted.
#[inline]
pub(crate) fn pane(cos: f32, eta: f32) -> f32 {
    let (r, _) = fresnel(cos, eta);
    // r + t²r + t²r³ + … with t = 1 − r
    2.0 * r / (1.0 + r)
}

/// Snell's law: the direction of `dir` behind a surface whose normal `n` points against it.
#[inline]
pub(crate) fn refract(dir: Vec3, n: Vec3, cos_i: f32, cos_t: f32, eta: f32) -> Vec3 {
    (dir / eta + n * (cos_i / eta - cos_t)).normalize()
}
