//! Polygons as triangles.

use crate::error::{LoadError, Place};
use glam::{DVec2, DVec3, Vec3};

/// Most tests of a corner against an ear, of all polygons of a mesh: those of a hostile one would be as many
/// as the cube of its corners.
const MAX_TESTS: u64 = 1 << 31;
/// Sine of the angle from which on a corner counts as reflex: what single precision leaves of a straight
/// line.
const STRAIGHT: f64 = 1e-5;

/// Cuts the polygons of a mesh.
#[derive(Debug, Default)]
pub(crate) struct Cutter {
    tests: u64,
}

impl Cutter {
    /// The triangles of a polygon, as numbers of its corners, which run as those of the polygon. A convex one
    /// is a fan from its first corner; of others, ears are cut off (Meisters 1975). A polygon that crosses
    /// itself is cut as far as that goes.
    pub(crate) fn cut(&mut self, corners: &[[f32; 3]], place: &Place) -> Result<Vec<[usize; 3]>, LoadError> {
        let flat = if corners.len() > 3 { flattened(corners) } else { vec![] };
        let mut left: Vec<usize> = (0..corners.len()).collect();
        let mut triangles = Vec::with_capacity(corners.len().saturating_sub(2));
        if (0..flat.len()).any(|i| is_reflex(around(&flat, &left, i))) {
            let mut at = 0;
            let mut without_ear = 0;
            while left.len() > 3 && without_ear < left.len() {
                self.tests += left.len() as u64;
                place.at_most("steps of cutting polygons so far", self.tests, MAX_TESTS)?;
                at %= left.len();
                if is_ear(&flat, &left, at) {
                    let [before, after] = [at + left.len() - 1, at + 1].map(|i| left[i % left.len()]);
                    triangles.push([before, left[at], after]);
                    left.remove(at);
                    without_ear = 0;
                } else {
                    at += 1;
                    without_ear += 1;
                }
            }
        }
        triangles
            .extend(left.get(1..).unwrap_or_default().windows(2).map(|pair| [left[0], pair[0], pair[1]]));
        Ok(triangles)
    }
}

/// The corners as seen from where they run counter-clockwise.
fn flattened(corners: &[[f32; 3]]) -> Vec<DVec2> {
    let points: Vec<DVec3> = corners.iter().map(|p| Vec3::from_array(*p).as_dvec3()).collect();
    // Newell's normal: that of the mean plane, however the polygon is bent
    let next = points.iter().skip(1).chain(&points[..1]);
    let normal: DVec3 = points.iter().zip(next).map(|(a, b)| (*a - points[0]).cross(*b - points[0])).sum();
    let u = normal.any_orthogonal_vector().normalize_or_zero();
    let v = normal.normalize_or_zero().cross(u);
    points.iter().map(|p| DVec2::new((*p - points[0]).dot(u), (*p - points[0]).dot(v))).collect()
}

/// A corner that is left, between those beside it.
fn around(flat: &[DVec2], left: &[usize], at: usize) -> [DVec2; 3] {
    let count = left.len();
    [at + count - 1, at, at + 1].map(|i| flat[left[i % count]])
}

fn is_reflex([a, b, c]: [DVec2; 3]) -> bool {
    let (to, from) = (b - a, c - b);
    to.perp_dot(from) < -STRAIGHT * to.length() * from.length()
}

/// Whether a corner can be cut off: it points outwards, and no other one lies in its triangle.
fn is_ear(flat: &[DVec2], left: &[usize], at: usize) -> bool {
    let [a, b, c] = around(flat, left, at);
    if (b - a).perp_dot(c - b) < 0.0 {
        return false;
    }
    let inside =
        |p: DVec2| [(a, b), (b, c), (c, a)].iter().all(|(p0, p1)| (*p1 - *p0).perp_dot(p - *p0) > 0.0);
    !left.iter().any(|i| inside(flat[*i]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::LoadFault;
    use std::path::Path;

    fn cut(corners: &[[f32; 3]]) -> Vec<[usize; 3]> {
        Cutter::default().cut(corners, &Place::file(Path::new("a.obj"))).unwrap()
    }

    /// The sum of the areas, where all triangles run counter-clockwise as seen from +z.
    fn area(corners: &[[f32; 3]]) -> f32 {
        let at = |i: usize| Vec3::from_array(corners[i]);
        let area = |[a, b, c]: &[usize; 3]| 0.5 * (at(*b) - at(*a)).cross(at(*c) - at(*a)).z;
        let triangles = cut(corners);
        assert_eq!(triangles.len(), corners.len() - 2);
        assert!(triangles.iter().all(|triangle| area(triangle) > -1e-6), "{triangles:?}");
        triangles.iter().map(area).sum()
    }

    #[test]
    fn convex_polygons_are_fans() {
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(cut(&square), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(cut(&square[..3]), [[0, 1, 2]]);
        assert_eq!(cut(&square[..2]), [[0; 3]; 0]);
    }

    /// Areas by the shoelace formula, whichever corner comes first.
    #[test]
    fn concave_polygons_keep_their_area() {
        let u = [[0, 0], [4, 0], [4, 4], [3, 4], [3, 1], [1, 1], [1, 4], [0, 4]];
        let chevron = [[0, 0], [2, 1], [4, 0], [2, 4]];
        let comb = [[0, 0], [7, 0], [7, 3], [6, 1], [5, 3], [4, 1], [3, 3], [2, 1], [1, 3]];
        // A square with a square hole, by a bridge from its corner
        let hole = [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0], [1, 1], [1, 3], [3, 3], [3, 1], [1, 1]];
        for (polygon, want) in [(&u[..], 10.0), (&chevron, 6.0), (&comb, 13.5), (&hole, 12.0)] {
            for first in 0..polygon.len() {
                let mut corners: Vec<_> = polygon.iter().map(|[x, y]| [*x as f32, *y as f32, 2.0]).collect();
                corners.rotate_left(first);
                assert!((area(&corners) - want).abs() < 1e-5, "{polygon:?} from {first}");
            }
        }
    }

    #[test]
    fn what_crosses_itself_or_has_no_plane_is_cut_somehow() {
        let bow = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(cut(&bow).len(), 2);
        assert_eq!(cut(&[[1.0; 3]; 5]).len(), 3);
        let corner = |i: u32| {
            let (angle, radius) = (i as f32 * 0.002, 1.0 + (i % 2) as f32);
            [radius * angle.cos(), radius * angle.sin(), 0.0]
        };
        let star: Vec<[f32; 3]> = (0..3000).map(corner).collect();
        assert_eq!(cut(&star).len(), 2998);
        let place = Place::file(Path::new("a.obj"));
        let mut cutter = Cutter { tests: MAX_TESTS };
        assert!(matches!(
            cutter.cut(&star, &place),
            Err(LoadError { fault: LoadFault::TooLarge { .. }, .. })
        ));
    }
}
