//! Maps of surroundings: pbrt's z points up.

use crate::mesh::rotation;
use glam::{DMat3, DVec3};
use noisefloor::Rgb;
use noisefloor_ptwne::EnvironmentMap;
use std::f64::consts::{FRAC_2_PI, PI, TAU};

/// A map of latitudes and longitudes, of pbrt 3: φ = 0 at +x on the left, θ = 0 at +z on top.
///
/// The map sees (x, y, z) at u = atan2(x, −z)/2π, with +y on top; pbrt at u = atan2(y, x)/2π, with +z on top: its x is
/// the map's −z, its y the map's x, its z the map's y.
pub(super) fn latitudes(
    width: usize,
    height: usize,
    pixels: Vec<Rgb>,
    [x, y, z]: [DVec3; 3],
) -> EnvironmentMap {
    let own = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::NEG_X);
    let to_world = rotation(DMat3::from_cols(x, y, z) * own);
    EnvironmentMap { width, height, pixels, to_world, poles: false }
}

/// The pixels of a square map of equal areas (Clarberg 2008), of pbrt 4, as one of latitudes and longitudes.
pub(super) fn equal_area(side: usize, square: &[Rgb]) -> Vec<Rgb> {
    let (width, height) = (2 * side, side);
    let mut pixels = Vec::with_capacity(width * height);
    for row in 0..height {
        let (sin, cos) = (PI * (row as f64 + 0.5) / height as f64).sin_cos();
        for column in 0..width {
            let (y, x) = (TAU * (column as f64 + 0.5) / width as f64).sin_cos();
            let [u, v] = to_square(DVec3::new(sin * x, sin * y, cos));
            let at = |s: f64| ((s * side as f64) as usize).min(side - 1);
            pixels.push(square[at(v) * side + at(u)]);
        }
    }
    pixels
}

/// Where in the unit square a direction of length 1 is seen.
fn to_square(dir: DVec3) -> [f64; 2] {
    let a = dir.abs();
    let (large, small) = (a.x.max(a.y), a.x.min(a.y));
    let angle = if large == 0.0 { 0.0 } else { (small / large).atan() * FRAC_2_PI };
    let angle = if a.x < a.y { 1.0 - angle } else { angle };
    let radius = (1.0 - a.z).max(0.0).sqrt();
    let (mut u, mut v) = (radius - angle * radius, angle * radius);
    if dir.z < 0.0 {
        (u, v) = (1.0 - v, 1.0 - u);
    }
    [u.copysign(dir.x), v.copysign(dir.y)].map(|x| 0.5 * (x + 1.0))
}

/// How far a point of the unit square lies above the horizon: the z of its direction.
pub(super) fn height([u, v]: [f64; 2]) -> f64 {
    let inside = 1.0 - (2.0 * u - 1.0).abs() - (2.0 * v - 1.0).abs();
    let radius = 1.0 - inside.abs();
    (1.0 - radius * radius).copysign(inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners are −z, the middle is +z, and the axes lie on the edges of the inner diamond.
    #[test]
    fn squares_are_those_of_pbrt() {
        for (dir, want) in [
            (DVec3::Z, [0.5, 0.5]),
            (DVec3::X, [1.0, 0.5]),
            (DVec3::NEG_X, [0.0, 0.5]),
            (DVec3::Y, [0.5, 1.0]),
            (DVec3::NEG_Y, [0.5, 0.0]),
            (DVec3::NEG_Z, [1.0, 1.0]),
        ] {
            let got = to_square(dir);
            assert!((height(got) - dir.z).abs() < 1e-9, "{dir}");
            assert!((got[0] - want[0]).abs() < 1e-9 && (got[1] - want[1]).abs() < 1e-9, "{dir} {got:?}");
        }
    }

    /// Equal areas: as many directions of a uniform set in each quarter of the square.
    #[test]
    fn squares_have_equal_areas() {
        let mut counts = [0i32; 16];
        let n = 40_000i32;
        for i in 0..n {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(n);
            let (y, x) = (f64::from(i) * 2.399_963).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let [u, v] = to_square(DVec3::new(r * x, r * y, z));
            assert!((height([u, v]) - z).abs() < 1e-9);
            counts[(v * 4.0).min(3.0) as usize * 4 + (u * 4.0).min(3.0) as usize] += 1;
        }
        assert!(counts.iter().all(|c| (c - n / 16).abs() < n / 160), "{counts:?}");
    }
}
