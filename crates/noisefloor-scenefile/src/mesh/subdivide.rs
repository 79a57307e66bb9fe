//! Loop's subdivision of triangle meshes (Loop 1987; masks of the limit: Hoppe et al. 1994, §3) with the weights of
//! Warren 1995, which pbrt has.

use super::Triangles;
use glam::DVec3;
use std::collections::HashMap;

/// A mesh without anything at its corners.
struct Net {
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

/// An edge, and the corners opposite to it.
#[derive(Default)]
struct Edge {
    /// The vertex that halves it.
    middle: u32,
    opposite: [u32; 2],
    faces: u32,
}

/// Edges by their ends, the smaller index first.
type Edges = HashMap<[u32; 2], Edge>;

/// What a vertex has around it.
#[derive(Clone, Copy, Default)]
struct Ring {
    edges: u32,
    sum: DVec3,
    /// Edges on the rim of the surface, or where more than two triangles meet.
    creases: u32,
    crease_sum: DVec3,
}

/// Triangles that `levels` of subdivision make of `count`; none if that is beyond all numbers.
pub(crate) fn triangles_after(count: u64, levels: u32) -> Option<u64> {
    4u64.checked_pow(levels)?.checked_mul(count)
}

/// Subdivides a mesh, and moves its vertices onto the surface to which subdivision converges. Rims become smooth
/// curves. Normals are those of the result, in the mean over its triangles; texture coordinates are left out.
///
/// Indices must be in range, and [`triangles_after`] in memory.
pub(crate) fn subdivide(mesh: &Triangles, levels: u32) -> Triangles {
    let positions = mesh.positions.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect();
    let whole = |[a, b, c]: &&[u32; 3]| a != b && b != c && c != a;
    let mut net = Net { positions, triangles: mesh.indices.iter().filter(whole).copied().collect() };
    for _ in 0..levels {
        net = net.finer();
    }
    let rings = net.rings(&net.edges());
    let positions = net.positions.iter().zip(&rings).map(|(p, ring)| ring.limit(*p).as_vec3().to_array());
    let mut fine =
        Triangles { positions: positions.collect(), indices: net.triangles, ..Triangles::default() };
    fine.smooth();
    fine
}

impl Net {
    fn edges(&self) -> Edges {
        let mut edges = Edges::with_capacity(self.triangles.len() * 2);
        let mut next = self.positions.len() as u32;
        for [a, b, c] in &self.triangles {
            for (from, to, opposite) in [(a, b, c), (b, c, a), (c, a, b)] {
                let edge = edges.entry([*from.min(to), *from.max(to)]).or_insert_with(|| {
                    next += 1;
                    Edge { middle: next - 1, ..Edge::default() }
                });
                if let Some(slot) = edge.opposite.get_mut(edge.faces as usize) {
                    *slot = *opposite;
                }
                edge.faces += 1;
            }
        }
        edges
    }

    fn rings(&self, edges: &Edges) -> Vec<Ring> {
        // In the order of the vertices that halve them, so that sums are rounded alike each time
        let mut sorted: Vec<(&[u32; 2], &Edge)> = edges.iter().collect();
        sorted.sort_by_key(|(_, edge)| edge.middle);
        let mut rings = vec![Ring::default(); self.positions.len()];
        for (ends, edge) in sorted {
            for (at, other) in [(ends[0], ends[1]), (ends[1], ends[0])] {
                let (ring, other) = (&mut rings[at as usize], self.positions[other as usize]);
                ring.edges += 1;
                ring.sum += other;
                if edge.faces != 2 {
                    ring.creases += 1;
                    ring.crease_sum += other;
                }
            }
        }
        rings
    }

    /// The mesh with four triangles for each.
    fn finer(&self) -> Self {
        let edges = self.edges();
        let rings = self.rings(&edges);
        let mut positions: Vec<DVec3> =
            self.positions.iter().zip(&rings).map(|(p, ring)| ring.moved(*p)).collect();
        positions.resize(self.positions.len() + edges.len(), DVec3::ZERO);
        let at = |i: u32| self.positions[i as usize];
        for ([a, b], edge) in &edges {
            let ends = at(*a) + at(*b);
            positions[edge.middle as usize] = match (edge.faces, edge.opposite) {
                (2, [c, d]) => ends * 0.375 + (at(c) + at(d)) * 0.125,
                _ => ends * 0.5,
            };
        }
        let middle = |a: u32, b: u32| edges[&[a.min(b), a.max(b)]].middle;
        let mut triangles = Vec::with_capacity(self.triangles.len() * 4);
        for &[a, b, c] in &self.triangles {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        Self { positions, triangles }
    }
}

impl Ring {
    /// The weight of each neighbour. Loop's own weights differ from Warren's, but for three and six neighbours.
    fn weight(&self) -> f64 {
        if self.edges == 3 { 3.0 / 16.0 } else { 0.375 / f64::from(self.edges) }
    }

    /// Where a step of subdivision moves the vertex.
    fn moved(&self, p: DVec3) -> DVec3 {
        match self.creases {
            0 if self.edges > 0 => {
                p * (1.0 - f64::from(self.edges) * self.weight()) + self.sum * self.weight()
            }
            2 => p * 0.75 + self.crease_sum * 0.125,
            // A corner, or of no triangle
            _ => p,
        }
    }

    /// Where all steps together move it: the left eigenvectors of [`Self::moved`].
    fn limit(&self, p: DVec3) -> DVec3 {
        match self.creases {
            0 if self.edges > 0 => {
                let n = f64::from(self.edges);
                let each = 1.0 / (n + 0.375 / self.weight());
                p * (1.0 - n * each) + self.sum * each
            }
            2 => (p * 4.0 + self.crease_sum) / 6.0,
            _ => p,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: &[[f32; 3]], indices: &[[u32; 3]]) -> Triangles {
        Triangles { positions: positions.to_vec(), indices: indices.to_vec(), ..Triangles::default() }
    }

    fn octahedron() -> Triangles {
        let positions = [
            [1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ];
        let indices =
            [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        mesh(&positions, &indices)
    }

    fn lengths(mesh: &Triangles) -> [f32; 2] {
        let lengths = mesh.positions.iter().map(|p| glam::Vec3::from(*p).length());
        lengths.fold([f32::INFINITY, 0.0], |[low, high], l| [low.min(l), high.max(l)])
    }

    #[test]
    fn closed_surfaces_stay_closed() {
        for levels in 0..5 {
            let fine = subdivide(&octahedron(), levels);
            assert_eq!(Some(fine.indices.len() as u64), triangles_after(8, levels));
            // Euler: V − E + F = 2, with 3F = 2E
            assert_eq!(fine.positions.len(), fine.indices.len() / 2 + 2);
            let net = Net {
                positions: fine.positions.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect(),
                triangles: fine.indices,
            };
            assert!(net.edges().values().all(|edge| edge.faces == 2));
        }
        assert_eq!(triangles_after(8, 40), None);
    }

    /// The limit does not depend on how finely it is drawn. Where the octahedron's own vertices end up is known: with
    /// four neighbours around it whose mean is the middle, β = 3/32, and the limit keeps 1 − 4/(4 + 4) = 1/2 of a
    /// vertex.
    #[test]
    fn octahedra_become_round() {
        for levels in 0..5 {
            let fine = subdivide(&octahedron(), levels);
            for (i, p) in fine.positions[..6].iter().enumerate() {
                let expected = octahedron().positions[i].map(|x| x * 0.5);
                assert!((glam::Vec3::from(*p) - glam::Vec3::from(expected)).length() < 1e-6, "{p:?}");
            }
        }
        // The middle of an edge: 3/8 (a + b) after a step, among 5/8 a, 5/8 b and four such middles; half of it and a
        // twelfth of those are 29/96 (a + b).
        let fine = subdivide(&octahedron(), 4);
        let middle = glam::Vec3::new(29.0 / 96.0, 29.0 / 96.0, 0.0);
        assert!(fine.positions.iter().any(|p| (glam::Vec3::from(p.map(f32::abs)) - middle).length() < 1e-6));
        // Round but for 21 %: the radius, largest at the vertices, and normals along it
        let [low, high] = lengths(&fine);
        assert!(high / low < 1.21 && high < 0.5 + 1e-6, "{low} {high}");
        for (p, n) in fine.positions.iter().zip(&fine.normals) {
            assert!(glam::Vec3::from(*p).normalize().dot(glam::Vec3::from(*n)) > 0.95);
        }
    }

    /// A flat net of a regular grid stays flat, its inside where it is, and its rim becomes a cubic B-spline, whose
    /// corners are at (4p + q + r)/6.
    #[test]
    fn flat_nets_stay_flat() {
        let n = 5u32;
        let positions: Vec<[f32; 3]> = (0..n * n).map(|i| [(i % n) as f32, (i / n) as f32, 7.0]).collect();
        let square = |x: u32, y: u32| {
            let at = |x: u32, y: u32| y * n + x;
            [[at(x, y), at(x + 1, y), at(x + 1, y + 1)], [at(x, y), at(x + 1, y + 1), at(x, y + 1)]]
        };
        let indices: Vec<[u32; 3]> =
            (0..n - 1).flat_map(|y| (0..n - 1).flat_map(move |x| square(x, y))).collect();
        let net = mesh(&positions, &indices);
        let fine = subdivide(&net, 3);
        assert!(fine.positions.iter().all(|p| (p[2] - 7.0).abs() < 1e-6));
        assert!(fine.normals.iter().all(|n| n[2] > 0.999_99));
        let near = |i: usize, [x, y]: [f32; 2]| {
            let p = fine.positions[i];
            assert!((p[0] - x).abs() < 1e-5 && (p[1] - y).abs() < 1e-5, "{i}: {p:?}");
        };
        // The middle, a vertex of the rim, and a corner: (4·(0, 0) + (1, 0) + (0, 1))/6
        near(12, [2.0, 2.0]);
        near(2, [2.0, 0.0]);
        near(0, [1.0 / 6.0, 1.0 / 6.0]);
    }

    #[test]
    fn odd_meshes_do_no_harm() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3]];
        // Three triangles at one edge, one without area, a vertex of no triangle
        let odd = mesh(&positions, &[[0, 1, 2], [1, 0, 3], [0, 1, 4], [2, 2, 1]]);
        let fine = subdivide(&odd, 2);
        assert_eq!(fine.indices.len(), 48);
        assert!(fine.positions.iter().flatten().chain(fine.normals.iter().flatten()).all(|x| x.is_finite()));
        assert!(subdivide(&Triangles::default(), 3).indices.is_empty());
    }
}
