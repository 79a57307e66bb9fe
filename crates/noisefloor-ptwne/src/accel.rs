//! Where rays meet surfaces: a bounding volume hierarchy, built by `obvhs` and walked four boxes and four surfaces at once.
//! Why so: `docs/benchmarks/bvh.md` beside this crate.

use crate::math::{Ray, Vec3};
use glam::Vec4;
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::Bvh2, bvh2::builder::build_bvh2};

/// A surface without its looks.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    /// The points `corner + u·e1 + v·e2`: with u, v ∈ [0, 1] a parallelogram (`whole`), else with u + v ≤ 1 a triangle.
    Planar { corner: glam::Vec3, e1: glam::Vec3, e2: glam::Vec3, whole: bool },
    /// A sphere.
    Sphere { centre: glam::Vec3, radius: f32 },
    /// An ellipse: the points `centre + u·e1 + v·e2` with u² + v² ≤ 1.
    Disk { centre: glam::Vec3, e1: glam::Vec3, e2: glam::Vec3 },
}

impl Shape {
    fn bounds(&self) -> Aabb {
        match *self {
            Shape::Planar { corner, e1, e2, whole } => {
                let last = if whole { corner + e1 + e2 } else { corner };
                Aabb::from_points(&[corner, corner + e1, corner + e2, last].map(Vec3::from))
            }
            Shape::Sphere { centre, radius } => Aabb::new((centre - radius).into(), (centre + radius).into()),
            Shape::Disk { centre, e1, e2 } => {
                let reach = (e1 * e1 + e2 * e2).map(f32::sqrt);
                Aabb::new((centre - reach).into(), (centre + reach).into())
            }
        }
    }

    /// The same shape, elsewhere.
    pub(crate) fn moved(self, by: glam::Vec3) -> Self {
        match self {
            Shape::Planar { corner, e1, e2, whole } => Shape::Planar { corner: corner + by, e1, e2, whole },
            Shape::Sphere { centre, radius } => Shape::Sphere { centre: centre + by, radius },
            Shape::Disk { centre, e1, e2 } => Shape::Disk { centre: centre + by, e1, e2 },
        }
    }

    /// Whether a pack has room for it: it is planar and straight.
    fn packs(&self) -> bool {
        matches!(self, Shape::Planar { .. })
    }
}

/// Lowest and highest corner of a box around shapes; none if there are no shapes.
pub(crate) fn bounds(shapes: &[Shape]) -> Option<[Vec3; 2]> {
    let all = shapes.iter().map(Shape::bounds).reduce(|a, b| a.union(&b))?;
    Some([all.min, all.max])
}

/// The normal and the dual basis of two edges, in f64: the area may be small.
fn dual(a: glam::DVec3, b: glam::DVec3) -> [glam::DVec3; 3] {
    let n = a.cross(b);
    let inverse = n.length_squared().recip();
    [n * inverse.sqrt(), b.cross(n) * inverse, n.cross(a) * inverse]
}

/// Corner and edges of a planar surface whose edges are moved outward by a distance, where that is more than [`EDGE`].
fn widened(
    corner: glam::Vec3,
    e1: glam::Vec3,
    e2: glam::Vec3,
    whole: bool,
    by: f64,
) -> (glam::Vec3, [glam::DVec3; 2]) {
    let [_, u, v] = dual(e1.as_dvec3(), e2.as_dvec3());
    let share = |dual: glam::DVec3| {
        let share = (by * dual.length()).min(WIDEST);
        if share > f64::from(EDGE) { share } else { 0.0 }
    };
    let (low_u, low_v) = (share(u), share(v));
    // u ≤ 1 and v ≤ 1 of a parallelogram, u + v ≤ 1 of a triangle
    let [high_u, high_v] = if whole { [low_u, low_v] } else { [low_v + share(u + v), low_u + share(u + v)] };
    let (a, b) = (e1.as_dvec3(), e2.as_dvec3());
    let corner = (corner.as_dvec3() - a * low_u - b * low_v).as_vec3();
    (corner, [a * (1.0 + low_u + high_u), b * (1.0 + low_v + high_v)])
}

/// Where a ray met a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    /// Distance along the ray; infinite if it met nothing.
    pub(crate) t: f32,
    /// Which surface, in the order of the hierarchy: see [`Accel::place`].
    slot: u32,
    /// Coordinates on a planar surface along its edges.
    pub(crate) uv: [f32; 2],
}

const MISS: Hit = Hit { t: f32::INFINITY, slot: u32::MAX, uv: [0.0; 2] };

impl Hit {
    #[inline]
    pub(crate) fn is_miss(&self) -> bool {
        self.slot == u32::MAX
    }
}

/// Marks the slot of a round surface.
const ROUND: u32 = 1 << 31;

/// Marks a child that is a leaf; the other bits are its index.
const LEAF: u32 = 1 << 31;
/// By how much the edge of a planar surface is widened, in units of its edges: rays do not slip between neighbours.
const EDGE: f32 = 2e-6;
/// By how much an edge is widened at least, over the scene's largest coordinate: four roundings. For surfaces so narrow that
/// this is more than [`EDGE`]: needles, and small triangles far from the origin.
const WIDER: f64 = 2.4e-7;
/// By how much a surface grows so at most, in units of its edges.
const WIDEST: f64 = 0.01;
/// No pack of planar surfaces in a leaf.
const NONE: u32 = u32::MAX;

/// Four boxes: for each axis the lower and the upper bounds.
#[derive(Clone, Debug)]
struct Node {
    bounds: [[Vec4; 2]; 3],
    child: [u32; 4],
}

/// Up to four planar surfaces, one a lane. With c the corner and n the normal of length one, a ray o + t·d meets the plane
/// at t = n·(c − o) / n·d, and there u and v are dot products with the dual basis of the edges. Lanes without a surface
/// are all zero: t is then NaN and no comparison holds.
#[derive(Clone, Debug, Default)]
struct Pack {
    corner: [Vec4; 3],
    normal: [Vec4; 3],
    dual_u: [Vec4; 3],
    dual_v: [Vec4; 3],
    /// One for parallelograms: u + v − whole·min(u, v) ≤ 1 bounds both kinds.
    whole: Vec4,
    prim: [u32; 4],
}

/// A sphere or an ellipse.
#[derive(Clone, Copy, Debug)]
struct Round {
    centre: Vec3,
    prim: u32,
    form: Form,
}

#[derive(Clone, Copy, Debug)]
enum Form {
    Sphere { radius: f32 },
    Disk { normal: Vec3, dual_u: Vec3, dual_v: Vec3 },
}

#[derive(Clone, Copy, Debug)]
struct Leaf {
    pack: u32,
    first_round: u32,
    rounds: u32,
}

/// The hierarchy.
#[derive(Clone, Debug)]
pub(crate) struct Accel {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    packs: Vec<Pack>,
    rounds: Vec<Round>,
    stack: usize,
    bounds: [Vec3; 2],
}

/// Nodes still to visit, with the distance at which each begins. Made once a job, so that no path allocates.
#[derive(Clone, Debug)]
pub(crate) struct Stack(Vec<(u32, f32)>);

/// A ray spread over the lanes.
struct Wide {
    origin: [Vec4; 3],
    dir: [Vec4; 3],
    inverse: [Vec4; 3],
    /// `origin`·`inverse`.
    shift: [Vec4; 3],
    /// For each axis, which bound the ray enters by.
    enter: [usize; 3],
}

impl Wide {
    #[inline]
    fn new(ray: &Ray) -> Self {
        // Keep inverses finite, so that no 0·∞ arises
        let tiny = ray.dir.abs().cmplt(Vec3::splat(1e-18));
        let inverse = Vec3::select(tiny, Vec3::splat(1e-18).copysign(ray.dir), ray.dir).recip();
        let (o, d, shift) = (ray.origin.to_array(), ray.dir.to_array(), (ray.origin * inverse).to_array());
        Self {
            origin: o.map(Vec4::splat),
            dir: d.map(Vec4::splat),
            inverse: inverse.to_array().map(Vec4::splat),
            shift: shift.map(Vec4::splat),
            enter: d.map(|d| usize::from(d.is_sign_negative())),
        }
    }
}

impl Node {
    const EMPTY: Self =
        Self { bounds: [[Vec4::splat(f32::MAX), Vec4::splat(f32::MIN)]; 3], child: [LEAF; 4] };

    /// Where the ray enters each box, and which boxes it meets before `t_max`.
    #[inline]
    fn meet(&self, ray: &Wide, t_max: f32) -> (Vec4, u32) {
        let near = |i: usize| self.bounds[i][ray.enter[i]] * ray.inverse[i] - ray.shift[i];
        let far = |i: usize| self.bounds[i][1 - ray.enter[i]] * ray.inverse[i] - ray.shift[i];
        let enter = near(0).max(near(1)).max(near(2).max(Vec4::ZERO));
        // Rounding must not lose a box: Ize 2013, "Robust BVH Ray Traversal"
        let leave = far(0).min(far(1)).min(far(2)) * 1.000_001;
        (enter, enter.cmple(leave.min(Vec4::splat(t_max))).bitmask())
    }
}

impl Pack {
    fn set(
        &mut self,
        lane: usize,
        corner: glam::Vec3,
        [normal, u, v]: [glam::DVec3; 3],
        whole: bool,
        prim: u32,
    ) {
        let put = |what: &mut [Vec4; 3], v: glam::DVec3| {
            for i in 0..3 {
                what[i][lane] = v[i] as f32;
            }
        };
        put(&mut self.corner, corner.as_dvec3());
        put(&mut self.normal, normal);
        put(&mut self.dual_u, u);
        put(&mut self.dual_v, v);
        self.whole[lane] = if whole { 1.0 } else { 0.0 };
        self.prim[lane] = prim;
    }

    /// Distances, u, v and the lanes met before `t_max`.
    #[inline]
    fn meet(&self, ray: &Wide, t_max: f32) -> (Vec4, Vec4, Vec4, u32) {
        let dot = |a: &[Vec4; 3], b: &[Vec4; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let to: [Vec4; 3] = std::array::from_fn(|i| self.corner[i] - ray.origin[i]);
        let t = dot(&self.normal, &to) / dot(&self.normal, &ray.dir);
        let at: [Vec4; 3] = std::array::from_fn(|i| ray.dir[i] * t - to[i]);
        let (u, v) = (dot(&self.dual_u, &at), dot(&self.dual_v, &at));
        let low = u.min(v);
        let inside = low.cmpge(Vec4::splat(-EDGE))
            & (u + v - self.whole * low).cmple(Vec4::splat(1.0 + EDGE))
            & t.cmpgt(Vec4::ZERO)
            & t.cmplt(Vec4::splat(t_max));
        (t, u, v, inside.bitmask())
    }
}

impl Round {
    fn new(shape: &Shape, prim: u32) -> Self {
        let (centre, form) = match *shape {
            Shape::Sphere { centre, radius } => (centre, Form::Sphere { radius }),
            Shape::Disk { centre, e1, e2 } | Shape::Planar { corner: centre, e1, e2, .. } => {
                let [normal, dual_u, dual_v] = dual(e1.as_dvec3(), e2.as_dvec3()).map(|v| v.as_vec3a());
                (centre, Form::Disk { normal, dual_u, dual_v })
            }
        };
        Self { centre: centre.into(), prim, form }
    }

    /// Nearest distance in (0, `t_max`) and coordinates along the edges, else none.
    #[inline]
    fn meet(&self, ray: &Ray, t_max: f32) -> Option<(f32, [f32; 2])> {
        let to = self.centre - ray.origin;
        let (t, uv) = match self.form {
            Form::Sphere { radius } => (sphere(to, ray.dir, radius)?, [0.0; 2]),
            Form::Disk { normal, dual_u, dual_v } => {
                let t = normal.dot(to) / normal.dot(ray.dir);
                let at = ray.dir * t - to;
                let uv = [dual_u.dot(at), dual_v.dot(at)];
                if uv[0] * uv[0] + uv[1] * uv[1] > 1.0 {
                    return None;
                }
                // Along the plane t is NaN, and not below `t_max`
                (t, uv)
            }
        };
        (t > 0.0 && t < t_max).then_some((t, uv))
    }
}

/// Where a ray from the origin first meets a sphere around `to`, in front. The discriminant is that of Haines et al. 2019
/// ("Precision Improvements for Ray/Sphere Intersection"): from the point nearest the centre, not from b² − c.
#[inline]
fn sphere(to: Vec3, dir: Vec3, radius: f32) -> Option<f32> {
    let b = to.dot(dir);
    let discriminant = radius * radius - (to - dir * b).length_squared();
    if discriminant <= 0.0 {
        return None;
    }
    let q = b + discriminant.sqrt().copysign(b);
    let (r1, r2) = ((to.length_squared() - radius * radius) / q, q);
    let (low, high) = if r1 < r2 { (r1, r2) } else { (r2, r1) };
    Some(if low > 0.0 { low } else { high })
}

impl Accel {
    /// Builds the hierarchy over `shapes`; planar ones must have an area.
    pub(crate) fn new(shapes: &[Shape]) -> Self {
        let (nodes, leaves, packs, rounds) = (vec![Node::EMPTY], vec![], vec![], vec![]);
        let mut accel = Self { nodes, leaves, packs, rounds, stack: 4, bounds: [Vec3::NEG_ONE, Vec3::ONE] };
        if shapes.is_empty() {
            return accel;
        }
        let bounds: Vec<Aabb> = shapes.iter().map(Shape::bounds).collect();
        let params = BvhBuildParams {
            pre_split: false,      // would need triangles
            max_prims_per_leaf: 1, // leaves are made below
            ..BvhBuildParams::slow_build()
        };
        let tree = build_bvh2(&bounds, params, &mut std::time::Duration::default());
        accel.bounds = [tree.nodes[0].aabb().min, tree.nodes[0].aabb().max];
        let mut depth = 1;
        accel.widen(&tree, shapes, &mut depth);
        accel.stack = 3 * depth + 4;
        // Leaves are looked up only where there are round surfaces
        if shapes.iter().all(Shape::packs) {
            accel.leaves = vec![];
        }
        accel.nodes.shrink_to_fit();
        accel.packs.shrink_to_fit();
        accel
    }

    /// Lowest and highest corner of a box around all surfaces.
    pub(crate) fn bounds(&self) -> [Vec3; 2] {
        self.bounds
    }

    /// Room for the nodes that a walk of this hierarchy can leave behind.
    pub(crate) fn stack(&self) -> Stack {
        Stack(vec![(0, 0.0); self.stack])
    }

    /// Collapses the binary tree: each wide node opens the largest of its inner children until it has four. What fits into
    /// one pack is a leaf, for a pack costs no more than a node.
    fn widen(&mut self, tree: &Bvh2, shapes: &[Shape], depth: &mut usize) {
        let mut todo = vec![(0usize, vec![0usize], 1usize)];
        while let Some((at, mut children, level)) = todo.pop() {
            *depth = level.max(*depth);
            while children.len() < 4 {
                let large = |i: &usize| few(tree, children[*i]).is_none();
                let area = |i: &usize| tree.nodes[children[*i]].aabb().half_area();
                let Some(open) = (0..children.len()).filter(large).max_by(|a, b| area(a).total_cmp(&area(b)))
                else {
                    break;
                };
                let first = tree.nodes[children.swap_remove(open)].first_index as usize;
                children.extend([first, first + 1]);
            }
            for (lane, &child) in children.iter().enumerate() {
                let node = &tree.nodes[child];
                for axis in 0..3 {
                    self.nodes[at].bounds[axis][0][lane] = node.aabb().min[axis];
                    self.nodes[at].bounds[axis][1][lane] = node.aabb().max[axis];
                }
                self.nodes[at].child[lane] = if let Some(prims) = few(tree, child) {
                    self.leaf(&prims, shapes)
                } else {
                    let first = node.first_index as usize;
                    let index = self.nodes.len();
                    self.nodes.push(Node::EMPTY);
                    todo.push((index, vec![first, first + 1], level + 1));
                    index as u32
                };
            }
        }
    }

    fn leaf(&mut self, prims: &[u32], shapes: &[Shape]) -> u32 {
        let mut leaf = Leaf { pack: NONE, first_round: self.rounds.len() as u32, rounds: 0 };
        let mut pack = Pack::default();
        let mut lane = 0;
        let [low, high] = self.bounds.map(|b| b.abs().max_element());
        let wider = WIDER * f64::from(low.max(high));
        for &prim in prims {
            let shape = &shapes[prim as usize];
            if let Shape::Planar { corner, e1, e2, whole } = *shape {
                let (corner, [e1, e2]) = widened(corner, e1, e2, whole, wider);
                pack.set(lane, corner, dual(e1, e2), whole, prim);
                lane += 1;
            } else {
                self.rounds.push(Round::new(shape, prim));
                leaf.rounds += 1;
            }
        }
        if lane > 0 {
            leaf.pack = self.packs.len() as u32;
            self.packs.push(pack);
        }
        self.leaves.push(leaf);
        LEAF | (self.leaves.len() - 1) as u32
    }

    /// What `hit` met, which must not be a miss.
    #[inline]
    pub(crate) fn place(&self, hit: &Hit) -> Place {
        if hit.slot & ROUND == 0 {
            let (pack, lane) = (&self.packs[(hit.slot >> 2) as usize], (hit.slot & 3) as usize);
            let at = |v: &[Vec4; 3]| Vec3::new(v[0][lane], v[1][lane], v[2][lane]);
            return Place {
                prim: pack.prim[lane],
                corner: at(&pack.corner),
                local: Local::Plane { normal: at(&pack.normal) },
            };
        }
        let round = &self.rounds[(hit.slot & !ROUND) as usize];
        let local = match round.form {
            Form::Sphere { radius } => Local::Sphere { radius },
            Form::Disk { normal, .. } => Local::Plane { normal },
        };
        Place { prim: round.prim, corner: round.centre, local }
    }

    /// The nearest surface along the ray. `solid` says whether the ray meets a surface, given by its index, at (u, v), or
    /// passes through a hole there.
    #[inline]
    pub(crate) fn closest(&self, ray: &Ray, stack: &mut Stack, solid: impl Fn(u32, [f32; 2]) -> bool) -> Hit {
        if self.rounds.is_empty() {
            self.nearest::<false>(ray, stack, solid)
        } else {
            self.nearest::<true>(ray, stack, solid)
        }
    }

    #[inline(never)]
    fn nearest<const ROUNDS: bool>(
        &self,
        ray: &Ray,
        stack: &mut Stack,
        solid: impl Fn(u32, [f32; 2]) -> bool,
    ) -> Hit {
        let wide = Wide::new(ray);
        let mut best = MISS;
        let mut top = 0;
        let mut node = 0u32;
        loop {
            if node & LEAF == 0 {
                let n = &self.nodes[node as usize];
                let (enter, mut mask) = n.meet(&wide, best.t);
                if mask != 0 {
                    // Go on with the nearest child, leave the others behind
                    let mut near = mask.trailing_zeros() as usize & 3;
                    mask &= mask - 1;
                    if mask != 0 {
                        let enter = enter.to_array();
                        while mask != 0 {
                            let mut other = mask.trailing_zeros() as usize & 3;
                            mask &= mask - 1;
                            if enter[other] < enter[near] {
                                std::mem::swap(&mut near, &mut other);
                            }
                            stack.0[top] = (n.child[other], enter[other]);
                            top += 1;
                        }
                    }
                    node = n.child[near];
                    continue;
                }
            } else {
                self.closest_in_leaf::<ROUNDS>(node, ray, &wide, &mut best, &solid);
            }
            // Take back what still begins before the nearest surface found
            loop {
                if top == 0 {
                    return best;
                }
                top -= 1;
                let (next, t) = stack.0[top];
                if t < best.t {
                    node = next;
                    break;
                }
            }
        }
    }

    #[inline]
    fn closest_in_leaf<const ROUNDS: bool>(
        &self,
        node: u32,
        ray: &Ray,
        wide: &Wide,
        best: &mut Hit,
        solid: &impl Fn(u32, [f32; 2]) -> bool,
    ) {
        let leaf = self.leaf_of::<ROUNDS>(node);
        if leaf.pack != NONE {
            let pack = &self.packs[leaf.pack as usize];
            let (t, u, v, mut mask) = pack.meet(wide, best.t);
            if mask != 0 {
                let (t, u, v) = (t.to_array(), u.to_array(), v.to_array());
                while mask != 0 {
                    let lane = mask.trailing_zeros() as usize & 3;
                    mask &= mask - 1;
                    if t[lane] < best.t && solid(pack.prim[lane], [u[lane], v[lane]]) {
                        *best =
                            Hit { t: t[lane], slot: leaf.pack << 2 | lane as u32, uv: [u[lane], v[lane]] };
                    }
                }
            }
        }
        if ROUNDS {
            for index in leaf.first_round..leaf.first_round + leaf.rounds {
                let round = &self.rounds[index as usize];
                if let Some((t, uv)) = round.meet(ray, best.t)
                    && solid(round.prim, uv)
                {
                    *best = Hit { t, slot: ROUND | index, uv };
                }
            }
        }
    }

    /// Without round surfaces each leaf has one pack, of the same index.
    #[inline]
    fn leaf_of<const ROUNDS: bool>(&self, node: u32) -> Leaf {
        let index = node & !LEAF;
        if ROUNDS { self.leaves[index as usize] } else { Leaf { pack: index, first_round: 0, rounds: 0 } }
    }

    /// Whether any surface lies on the ray before `t_max`; `HOLES` says whether some have holes, which `solid` knows.
    #[inline]
    pub(crate) fn blocked<const HOLES: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
        stack: &mut Stack,
        solid: impl Fn(u32, [f32; 2]) -> bool,
    ) -> bool {
        if self.rounds.is_empty() {
            self.any::<false, HOLES>(ray, t_max, stack, solid)
        } else {
            self.any::<true, HOLES>(ray, t_max, stack, solid)
        }
    }

    #[inline(never)]
    fn any<const ROUNDS: bool, const HOLES: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
        stack: &mut Stack,
        solid: impl Fn(u32, [f32; 2]) -> bool,
    ) -> bool {
        let wide = Wide::new(ray);
        let mut top = 0;
        let mut node = 0u32;
        loop {
            if node & LEAF == 0 {
                let n = &self.nodes[node as usize];
                let (_, mut mask) = n.meet(&wide, t_max);
                if mask != 0 {
                    // Go on with one child, leave the others behind
                    let child = |mask: u32| n.child[mask.trailing_zeros() as usize & 3];
                    node = child(mask);
                    mask &= mask - 1;
                    while mask != 0 {
                        stack.0[top].0 = child(mask);
                        top += 1;
                        mask &= mask - 1;
                    }
                    continue;
                }
            } else if self.blocked_in_leaf::<ROUNDS, HOLES>(node, ray, &wide, t_max, &solid) {
                return true;
            }
            if top == 0 {
                return false;
            }
            top -= 1;
            node = stack.0[top].0;
        }
    }

    #[inline]
    fn blocked_in_leaf<const ROUNDS: bool, const HOLES: bool>(
        &self,
        node: u32,
        ray: &Ray,
        wide: &Wide,
        t_max: f32,
        solid: &impl Fn(u32, [f32; 2]) -> bool,
    ) -> bool {
        let leaf = self.leaf_of::<ROUNDS>(node);
        if leaf.pack != NONE {
            let pack = &self.packs[leaf.pack as usize];
            let (_, u, v, mut mask) = pack.meet(wide, t_max);
            if !HOLES && mask != 0 {
                return true;
            }
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize & 3;
                mask &= mask - 1;
                if solid(pack.prim[lane], [u[lane], v[lane]]) {
                    return true;
                }
            }
        }
        let first = leaf.first_round as usize;
        let meets = |round: &Round| round.meet(ray, t_max).is_some_and(|(_, uv)| solid(round.prim, uv));
        ROUNDS && self.rounds[first..first + leaf.rounds as usize].iter().any(meets)
    }

    /// Whether any box of the hierarchy reaches into the pyramid of rays from `apex` between planes through it, whose normals
    /// point inward. May say yes where there is nothing, never no where there is something.
    pub(crate) fn reaches_into(&self, apex: Vec3, inward: &[Vec3; 4]) -> bool {
        let mut todo = vec![0u32];
        while let Some(index) = todo.pop() {
            let node = &self.nodes[index as usize];
            for lane in 0..4 {
                let bound =
                    |end: usize| Vec3::from_array(std::array::from_fn(|axis| node.bounds[axis][end][lane]));
                let (low, high) = (bound(0) - apex, bound(1) - apex);
                // Empty lanes have low > high. A thousandth of the size, and of the distance, covers rounding
                let slack = 1e-3 * high.abs().max(low.abs()).max_element();
                let meets = |n: &Vec3| Vec3::select(n.cmpgt(Vec3::ZERO), high, low).dot(*n) >= -slack;
                if low.cmple(high).all() && inward.iter().all(meets) {
                    match node.child[lane] {
                        child if child & LEAF == 0 => todo.push(child),
                        _ => return true,
                    }
                }
            }
        }
        false
    }

    /// Bytes that the hierarchy takes.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.leaves.as_slice())
            + size_of_val(self.packs.as_slice())
            + size_of_val(self.rounds.as_slice())
    }
}

/// What a hit met.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Its index among the shapes.
    pub(crate) prim: u32,
    /// A point of its plane; the centre of a sphere or ellipse.
    pub(crate) corner: Vec3,
    pub(crate) local: Local,
}

/// What a surface is like where it was met.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Local {
    /// Flat; the normal of its front, of length 1.
    Plane {
        normal: Vec3,
    },
    Sphere {
        radius: f32,
    },
}

/// The surfaces below a node, if they are at most four.
fn few(tree: &Bvh2, root: usize) -> Option<Vec<u32>> {
    let (mut found, mut todo) = (vec![], vec![root]);
    while let Some(index) = todo.pop() {
        let node = &tree.nodes[index];
        let first = node.first_index as usize;
        if node.is_leaf() {
            found.extend(&tree.primitive_indices[first..first + node.prim_count as usize]);
        } else {
            todo.extend([first, first + 1]);
        }
        if found.len() + todo.len() > 4 {
            return None;
        }
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math;
    use crate::rng::{Key, Rng};

    /// The hierarchy finds what a loop over all surfaces finds.
    #[test]
    fn walk_agrees_with_a_loop() {
        let mut rng = Rng::new(Key::new(7), 0, 0);
        let mut point =
            |scale: f32| glam::Vec3::from_array([rng.one(), rng.one(), rng.one()]) * scale - 0.5 * scale;
        let shapes: Vec<Shape> = (0..300)
            .map(|i| match i % 3 {
                0 => Shape::Sphere { centre: point(4.0), radius: 0.1 },
                1 if i % 2 == 0 => Shape::Disk { centre: point(4.0), e1: point(1.0), e2: point(1.0) },
                k => Shape::Planar { corner: point(4.0), e1: point(1.0), e2: point(1.0), whole: k == 1 },
            })
            .collect();
        let accel = Accel::new(&shapes);
        let alone: Vec<Accel> = shapes.iter().map(|s| Accel::new(&[*s])).collect();
        let mut stack = accel.stack();
        let mut met = 0;
        for i in 0..5000 {
            let mut rng = Rng::new(Key::new(8), i, 0);
            let ray = Ray { origin: point(4.0).into(), dir: math::sphere(rng.two()).normalize() };
            let hit = accel.closest(&ray, &mut stack, |_, _| true);
            let all = alone.iter().map(|a| a.closest(&ray, &mut stack, |_, _| true).t);
            let best = all.fold(f32::INFINITY, f32::min);
            // Alone, a surface is widened less
            assert!(hit.t == best || (hit.t - best).abs() < 1e-5 * best, "{} {best}", hit.t);
            assert_eq!(accel.blocked::<true>(&ray, f32::INFINITY, &mut stack, |_, _| true), best.is_finite());
            if best.is_finite() {
                met += 1;
                assert!(!accel.blocked::<true>(&ray, hit.t, &mut stack, |_, _| true));
            }
        }
        assert!(met > 500, "{met}");
    }

    #[test]
    fn an_empty_hierarchy_is_met_by_nothing() {
        let accel = Accel::new(&[]);
        let ray = Ray { origin: Vec3::ZERO, dir: Vec3::new(0.0, 0.6, -0.8) };
        assert!(accel.closest(&ray, &mut accel.stack(), |_, _| true).t.is_infinite());
        assert!(!accel.blocked::<false>(&ray, 1.0, &mut accel.stack(), |_, _| true));
    }
}
