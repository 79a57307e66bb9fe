//! The hierarchy of a scene: its own surfaces, and instances of objects.

use super::aabb::Aabb;
use super::bvh::{Bvh, HitShape, LocalHit};
use super::cut::Bounded;
use super::leaf::Spot;
use super::node::{Node, WideRay};
use super::tree::{Leaves, Tree, Waiting};
use crate::geometry::NO;
use crate::math::{Ray, Vec3};
use glam::{DAffine3, Mat3};

/// By how much the box of an instance is widened, relative to its coordinates: a few roundings.
const WIDENING: f32 = 1e-6;

/// Where a ray hit a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    /// Distance along the ray; infinite for a miss.
    pub(crate) t: f32,
    /// The surface, in the order of its hierarchy; [`NO`] for a miss.
    slot: u32,
    /// Coordinates along the edges of a planar surface.
    pub(crate) uv: [f32; 2],
    /// The instance that it is of; [`NO`] if it is of none.
    instance: u32,
}

impl Hit {
    #[inline]
    fn new(LocalHit { t, slot, uv }: LocalHit, instance: u32) -> Self {
        Self { t, slot, uv, instance }
    }

    #[inline]
    pub(crate) fn is_miss(&self) -> bool {
        self.slot == NO
    }
}

/// The surfaces of a scene, and those that its instances show again.
#[derive(Clone, Debug)]
pub(crate) struct Hierarchy {
    own: Bvh,
    objects: Vec<Bvh>,
    instances: Vec<Instance>,
    /// Over the boxes of the instances.
    tree: Tree,
    bounds: [Vec3; 2],
}

/// The leaves over instances: each is one of them, and has its number.
struct InstanceLeaves;

impl Leaves<(Aabb, u32)> for InstanceLeaves {
    fn none(&self) -> Self {
        Self
    }

    fn add(&mut self, instances: &[(Aabb, u32)]) -> u32 {
        instances[0].1
    }

    fn append(&mut self, _: Self) -> u32 {
        0
    }
}

impl Bounded for (Aabb, u32) {
    fn bounds(&self) -> Aabb {
        self.0
    }
}

/// An object in its place in the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instance {
    object: u32,
    /// Where the origin of the object's coordinates is.
    origin: glam::Vec3,
    to_object: Mat3,
    to_world: Mat3,
}

/// Nodes still to visit. Allocated once per job, so that no path allocates.
#[derive(Clone, Debug)]
pub(crate) struct Stack {
    instances: Waiting,
    surfaces: Waiting,
}

impl Instance {
    /// The object `object` moved by `to_world`; none if that is singular, or too near to it for `f32`.
    pub(crate) fn new(object: u32, to_world: DAffine3) -> Option<Self> {
        let inverse = to_world.matrix3.inverse();
        let (to_object, scaled) = (inverse.as_mat3(), to_world.matrix3.as_mat3());
        let origin = to_world.translation.as_vec3();
        let usable = |m: Mat3| m.to_cols_array().iter().all(|x| x.is_finite()) && m.determinant().is_normal();
        let exact = (inverse * to_world.matrix3).abs_diff_eq(glam::DMat3::IDENTITY, 1e-6);
        let fits = usable(to_object) && usable(scaled) && origin.is_finite() && exact;
        fits.then_some(Self { object, origin, to_object, to_world: scaled })
    }

    pub(crate) fn object(&self) -> usize {
        self.object as usize
    }

    pub(crate) fn translate(&mut self, by: Vec3) {
        self.origin += glam::Vec3::from(by);
    }

    /// The middle and half the extent of a box around an object with these corners, in the world.
    pub(crate) fn around(&self, [low, high]: [Vec3; 2]) -> [Vec3; 2] {
        let abs = Mat3::from_cols_array(&self.to_world.to_cols_array().map(f32::abs));
        [self.position(0.5 * (low + high)), abs * (0.5 * (high - low))]
    }

    /// A position of the world, in the object's coordinates.
    #[inline]
    pub(crate) fn local(&self, position: Vec3) -> Vec3 {
        self.to_object * (position - Vec3::from(self.origin))
    }

    /// A position of the object, in the world.
    #[inline]
    pub(crate) fn position(&self, local: Vec3) -> Vec3 {
        self.edge(local) + Vec3::from(self.origin)
    }

    /// A difference of two positions of the object, in the world.
    #[inline]
    pub(crate) fn edge(&self, local: Vec3) -> Vec3 {
        self.to_world * local
    }

    /// A normal of the object, in the world. It stays on its side, whether or not the instance is mirrored.
    #[inline]
    pub(crate) fn normal(&self, local: Vec3) -> Vec3 {
        (self.to_object.transpose() * local).normalize()
    }

    /// A normal of the world, in the object's coordinates.
    pub(crate) fn local_normal(&self, normal: Vec3) -> Vec3 {
        (self.to_world.transpose() * normal).normalize()
    }

    /// How far `position`, on the instance, is from the origin of the object's coordinates, along the axis on which
    /// that is most.
    #[inline]
    pub(crate) fn local_reach(&self, position: Vec3) -> f32 {
        (position - Vec3::from(self.origin)).abs().max_element()
    }

    /// A ray in the object's coordinates, and by how much distances along it are longer there.
    #[inline]
    fn local_ray(&self, ray: &Ray) -> (Ray, f32) {
        let dir = self.to_object * ray.dir;
        let length = dir.length();
        (Ray { origin: self.local(ray.origin), dir: dir / length }, length)
    }
}

impl Hierarchy {
    /// The hierarchy of a scene with surfaces of its own, and instances of `objects` that are not empty.
    pub(crate) fn new(own: Bvh, objects: Vec<Bvh>, instances: Vec<Instance>) -> Self {
        let boxes: Vec<Aabb> = instances
            .iter()
            .map(|instance| {
                let inside = objects[instance.object()].bounds.unwrap_or_default();
                let [middle, half] = instance.around(inside);
                let reach = half * (1.0 + WIDENING) + WIDENING * middle.abs().max_element();
                Aabb::new(middle - reach, middle + reach)
            })
            .collect();
        let numbered = boxes.iter().zip(0..).map(|(bounds, index)| (*bounds, index)).collect();
        let tree = Tree::new(numbered, 1, &mut InstanceLeaves);
        let own_box = own.bounds.map(|[low, high]| Aabb::new(low, high));
        let all = boxes.into_iter().chain(own_box).reduce(|a, b| a.union(&b));
        let bounds = all.map_or([Vec3::NEG_ONE, Vec3::ONE], |all| [all.min, all.max]);
        Self { own, objects, instances, tree, bounds }
    }

    /// Lowest and highest corner of the bounding box of all that there is.
    pub(crate) fn bounds(&self) -> [Vec3; 2] {
        self.bounds
    }

    pub(crate) fn instances(&self) -> usize {
        self.instances.len()
    }

    /// A stack for the nodes that a walk can leave behind.
    pub(crate) fn stack(&self) -> Stack {
        let surfaces = self.objects.iter().chain([&self.own]).map(|bvh| bvh.tree.waiting).max().unwrap_or(0);
        Stack { instances: Waiting::new(self.tree.waiting), surfaces: Waiting::new(surfaces) }
    }

    /// The nearest surface along the ray. `solid` decides whether the surface of an index, of an instance or of
    /// none ([`NO`]), stops the ray at a spot or is transparent there.
    #[inline]
    pub(crate) fn closest(
        &self,
        ray: &Ray,
        stack: &mut Stack,
        solid: impl Fn(u32, u32, Spot) -> bool,
    ) -> Hit {
        let own =
            self.own.closest(ray, f32::INFINITY, &mut stack.surfaces, |prim, spot| solid(prim, NO, spot));
        let own = Hit::new(own, NO);
        if self.instances.is_empty() { own } else { self.closest_instance(ray, own, stack, solid) }
    }

    #[inline(never)]
    fn closest_instance(
        &self,
        ray: &Ray,
        mut best: Hit,
        stack: &mut Stack,
        solid: impl Fn(u32, u32, Spot) -> bool,
    ) -> Hit {
        self.tree.nearest(&WideRay::new(ray), best.t, &mut stack.instances, Node::meet, |index| {
            let instance = &self.instances[index as usize];
            let (local, longer) = instance.local_ray(ray);
            let object = &self.objects[instance.object()];
            let t_max = best.t * longer;
            let hit =
                object.closest(&local, t_max, &mut stack.surfaces, |prim, spot| solid(prim, index, spot));
            let t = hit.t / longer;
            if hit.slot != NO && t < best.t {
                best = Hit::new(LocalHit { t, ..hit }, index);
            }
            best.t
        });
        best
    }

    /// Whether any surface lies on the ray before `t_max`. `OPACITY` says whether `solid` needs to be asked.
    #[inline]
    pub(crate) fn blocked<const OPACITY: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
        stack: &mut Stack,
        solid: impl Fn(u32, u32, Spot) -> bool,
    ) -> bool {
        self.own.blocked::<OPACITY>(ray, t_max, &mut stack.surfaces, |prim, spot| solid(prim, NO, spot))
            || !self.instances.is_empty() && self.blocked_by_instance::<OPACITY>(ray, t_max, stack, solid)
    }

    #[inline(never)]
    fn blocked_by_instance<const OPACITY: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
        stack: &mut Stack,
        solid: impl Fn(u32, u32, Spot) -> bool,
    ) -> bool {
        self.tree.any(&WideRay::new(ray), t_max, &mut stack.instances, Node::meet, |index| {
            let instance = &self.instances[index as usize];
            let (local, longer) = instance.local_ray(ray);
            let object = &self.objects[instance.object()];
            object.blocked::<OPACITY>(&local, t_max * longer, &mut stack.surfaces, |prim, spot| {
                solid(prim, index, spot)
            })
        })
    }

    /// The instance that was hit, if it was one.
    #[inline]
    pub(crate) fn instance(&self, hit: &Hit) -> Option<&Instance> {
        self.instances.get(hit.instance as usize)
    }

    /// The index of the surface that was hit, and its shape there, in coordinates of its object. The hit must not
    /// be a miss; without `INSTANCE`, nor of an instance.
    #[inline]
    pub(crate) fn shape_at<const INSTANCE: bool>(&self, hit: &Hit) -> (u32, HitShape) {
        if INSTANCE { self.hit(hit).shape_at(hit.slot) } else { self.own.shape_at(hit.slot) }
    }

    /// The edges of the planar surface or ellipse that was hit, along which its coordinates run, in coordinates
    /// of its object; none for spheres.
    pub(crate) fn edges(&self, hit: &Hit) -> Option<[Vec3; 2]> {
        self.hit(hit).edges(hit.slot)
    }

    /// The hierarchy that has the surface that was hit.
    #[inline]
    fn hit(&self, hit: &Hit) -> &Bvh {
        self.instance(hit).map_or(&self.own, |instance| &self.objects[instance.object()])
    }

    /// Whether anything may overlap the pyramid of rays from `apex` between planes through it with these inward
    /// normals. Conservative: never false if a surface overlaps it.
    pub(crate) fn reaches_into(&self, apex: Vec3, inward: &[Vec3; 4]) -> bool {
        self.own.tree.reaches_into(apex, inward) || self.tree.reaches_into(apex, inward)
    }

    /// Memory that it takes, in bytes.
    pub(crate) fn bytes(&self) -> usize {
        self.own.bytes()
            + self.objects.iter().map(Bvh::bytes).sum::<usize>()
            + self.tree.bytes()
            + size_of_val(self.instances.as_slice())
    }
}
