//! Slopes of Beckmann's facets that a direction sees (Heitz, d'Eon 2014, "Importance Sampling Microfacet-Based
//! BSDFs using the Distribution of Visible Normals", supplement 2).

use crate::math::Vec3;
use libm::erff;
use std::f32::consts::FRAC_2_SQRT_PI;

/// Steps of the inversion; a fourth changes nothing that f32 resolves.
const STEPS: u32 = 3;

/// Slopes along x and y of a facet of a surface with α = 1, seen from `wo`; its normal is (−x, −y, 1).
///
/// Across the plane of view slopes are normal; along it their density is weighted by the area that `wo` sees. With
/// the slope written as erf⁻¹(t), that integrates to 1 + t + tan θ · exp(−slope²) / √π, which is inverted
/// (Jakob 2014).
#[inline(never)]
pub(super) fn visible_slopes(wo: Vec3, [u, v]: [f32; 2]) -> [f32; 2] {
    let within = |u: f32| u.clamp(1e-6, 1.0 - 1e-6);
    let across = inverse_erf(2.0 * within(v) - 1.0);
    let sin = (wo.x * wo.x + wo.y * wo.y).sqrt();
    if sin < 1e-5 {
        return [inverse_erf(2.0 * within(u) - 1.0), across];
    }
    let (cot, tan) = (wo.z / sin, sin / wo.z.max(1e-6));
    let bump = |slope: f32| 0.5 * FRAC_2_SQRT_PI * tan * (-slope * slope).exp();
    // Slopes beyond cot θ face away
    let most = erff(cot);
    let target = within(u) * (1.0 + most + bump(cot));
    // Newton's steps from what is exact at grazing angles, where the function is bent most
    let mut t = most - (most + 1.0) * erff((-within(u).ln()).sqrt());
    for _ in 0..STEPS {
        let along = inverse_erf(t);
        let off = 1.0 + t + bump(along) - target;
        t = (t - off / (1.0 - along * tan).max(1e-6)).clamp(-1.0, most);
    }
    let (along, x, y) = (inverse_erf(t), wo.x / sin, wo.y / sin);
    [along * x - across * y, along * y + across * x]
}

/// The inverse of the error function, to 3e-7 of the result (Giles 2012, "Approximating the erfinv Function", single precision).
fn inverse_erf(x: f32) -> f32 {
    const MIDDLE: [f32; 9] = [
        2.810_226_4e-8,
        3.432_739_4e-7,
        -3.523_387_7e-6,
        -4.391_506_5e-6,
        0.000_218_580_87,
        -0.001_253_725,
        -0.004_177_681_6,
        0.246_640_73,
        1.501_409_4,
    ];
    const ENDS: [f32; 9] = [
        -0.000_200_214_26,
        0.000_100_950_56,
        0.001_349_343_2,
        -0.003_673_428_4,
        0.005_739_507_7,
        -0.007_622_461_3,
        0.009_438_87,
        1.001_674,
        2.832_976_8,
    ];
    let w = -((1.0 - x) * (1.0 + x)).max(1e-30).ln();
    let (w, terms) = if w < 5.0 { (w - 2.5, MIDDLE) } else { (w.sqrt() - 3.0, ENDS) };
    terms.iter().fold(0.0, |sum, term| sum * w + term) * x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_functions_are_inverse() {
        // From tables
        for (x, value) in [(0.1, 0.112_462_92), (0.5, 0.520_499_9), (1.0, 0.842_700_8), (2.0, 0.995_322_3)] {
            assert!((erff(x) - value).abs() < 3e-7);
            assert!((inverse_erf(value) - x).abs() < 1e-5 && (inverse_erf(-value) + x).abs() < 1e-5);
        }
        assert_eq!(inverse_erf(0.0), 0.0);
        assert!(inverse_erf(-1.0).is_finite() && inverse_erf(1.0).is_finite());
    }

    /// Slopes are finite whatever is looked at, and no facet faces away.
    #[test]
    fn slopes_are_those_of_facets_that_are_seen() {
        for i in 0..2000 {
            let number = |k: u32| (i * k % 2000) as f32 / 2000.0;
            let (cos, (sin_phi, cos_phi)) = (number(7).powi(3), (6.3 * number(11)).sin_cos());
            let sin = (1.0 - cos * cos).sqrt();
            let wo = Vec3::new(sin * cos_phi, sin * sin_phi, cos);
            let [x, y] = visible_slopes(wo, [number(13), number(3)]);
            let seen = Vec3::new(-x, -y, 1.0).normalize().dot(wo);
            assert!(seen > -1e-3, "{wo}: {x} {y}, {seen}");
        }
    }
}
