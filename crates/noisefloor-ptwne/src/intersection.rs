//! Rays through a scene, and the surfaces they hit.

use crate::accel::{Hit, HitShape, Spot, Stack};
use crate::bsdf::{Glossy, LobesAt, MIN_ROUGHNESS, RoughGlass, schlick};
use crate::geometry::{Group, Intersection, NO, RINGS, RINGS_REVERSED};
use crate::material::Bsdf;
use crate::math::{Frame, Ray, Vec3};
use crate::relief::{self, Relief};
use crate::sampler::Draws;
use crate::scene::Scene;
use crate::texture::{Coordinates, Texture, twice};
use std::f32::consts::PI;

/// What a coat with an index of refraction of 1.5 reflects at normal incidence.
const COAT: f32 = 0.04;

/// By how much origins of scattered rays are moved off a surface, relative to the largest coordinate: a few
/// hundred roundings.
const OFFSET: f32 = 1e-5;

/// The choice between the parts of a mix, among [`Draws`] of surfaces: none has this index.
const PART: u64 = u64::MAX;
/// The largest number below 1.
const BELOW_1: f32 = 1.0 - f32::EPSILON / 2.0;

impl Scene {
    /// The nearest surface along the ray.
    #[inline]
    pub(crate) fn closest<const OPACITY: bool>(&self, ray: &Ray, stack: &mut Stack, draws: Draws) -> Hit {
        if OPACITY {
            self.bvh.closest(ray, stack, |prim, instance, spot| self.is_solid(prim, instance, spot, draws))
        } else {
            self.bvh.closest(ray, stack, |_, _, _| true)
        }
    }

    /// Whether any surface lies on the ray before `t_max`.
    #[inline]
    pub(crate) fn blocked<const OPACITY: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
        stack: &mut Stack,
        draws: Draws,
    ) -> bool {
        if OPACITY {
            self.bvh.blocked::<true>(ray, t_max, stack, |prim, instance, spot| {
                let material = self.geometry.group(prim).material;
                self.is_solid(prim, instance, spot, draws) && !self.materials[material as usize].is_nothing()
            })
        } else {
            self.bvh.blocked::<false>(ray, t_max, stack, |_, _, _| true)
        }
    }

    fn is_solid(&self, prim: u32, instance: u32, spot: Spot, draws: Draws) -> bool {
        let group = self.geometry.group(prim);
        let material = &self.materials[group.material as usize];
        let (Spot::Plane { front, .. } | Spot::Sphere { front, .. }) = spot;
        if material.culled && !front {
            return false;
        }
        match &material.opacity {
            None => true,
            Some(opacity) => {
                let (at, far) = match spot {
                    Spot::Plane { uv, .. } => (self.geometry.texture_coordinates(group, prim, uv), false),
                    Spot::Sphere { normal, far, .. } => {
                        (twice(sphere_coordinates(self.geometry.to_local(group, normal))), far)
                    }
                };
                let c = opacity.eval(at);
                // Of equal channels the mean is rounded, which a cutoff would notice
                let mut opacity = match material.cutoff {
                    Some(_) => c.max_element(),
                    None => (c.x + c.y + c.z) * (1.0 / 3.0),
                };
                if let (Some(Texture::Corners(_)), Spot::Plane { uv, .. }) = (&material.opacity, spot)
                    && group.alphas != NO
                {
                    opacity *= self.geometry.alpha(group, prim, uv);
                }
                if let Some(cutoff) = material.cutoff {
                    return opacity >= cutoff;
                }
                // The two sides of a sphere decide for themselves, and so do instances
                let side = u64::from(far) << 63 | u64::from(instance.wrapping_add(1)) << 32;
                draws.number(side | u64::from(prim)) < opacity
            }
        }
    }

    /// The surface that the ray hit; of a mix one of its parts.
    #[inline]
    pub(crate) fn surface(&self, ray: &Ray, hit: &Hit, draws: Draws) -> Intersection<'_> {
        match self.bvh.instance(hit) {
            None => self.surface_of::<false>(ray, hit, draws),
            Some(_) => self.surface_of::<true>(ray, hit, draws),
        }
    }

    fn surface_of<const INSTANCE: bool>(&self, ray: &Ray, hit: &Hit, draws: Draws) -> Intersection<'_> {
        let (prim, shape) = self.bvh.shape_at::<INSTANCE>(hit);
        let group = self.geometry.group(prim);
        let material = &self.materials[group.material as usize];
        let instance = if INSTANCE { self.bvh.instance(hit) } else { None };
        let along = ray.origin + ray.dir * hit.t;
        let along = instance.map_or(along, |instance| instance.local(along));
        // Back onto the surface: an error along it does no harm, one across it would
        let (mut position, mut flat) = match shape {
            HitShape::Plane { point, normal } => (along - normal * normal.dot(along - point), normal),
            HitShape::Sphere { centre, radius } => {
                let n = (along - centre).normalize();
                (centre + n * radius, n)
            }
        };
        let uv = match shape {
            HitShape::Sphere { .. } => twice(sphere_coordinates(self.geometry.to_local(group, flat))),
            HitShape::Plane { .. } => self.geometry.texture_coordinates(group, prim, hit.uv),
        };
        let mut normal = flat;
        if group.normals != NO {
            normal = self.geometry.shading_normal(group, prim, hit.uv).unwrap_or(flat);
        }
        let mut offset = self.offset;
        if let Some(instance) = instance {
            position = instance.position(position);
            (flat, normal) = (instance.normal(flat), instance.normal(normal));
            offset = offset.max(instance.local_reach(position) * OFFSET);
        }
        // Turn both normals towards the ray's origin
        let front = ray.dir.dot(flat) < 0.0;
        if !front {
            (flat, normal) = (-flat, -normal);
        }
        if normal.dot(ray.dir) >= 0.0 {
            normal = flat;
        }
        let tint = if group.colours == NO { Vec3::ONE } else { self.geometry.tint(group, prim, hit.uv) };
        let (mut material, mut relief) = (material, &material.relief);
        let mut number = if let Bsdf::Mix { .. } = material.bsdf { draws.number(PART) } else { 0.0 };
        while let Bsdf::Mix { parts, share, coat } = &material.bsdf {
            let share = share.tinted(uv, tint);
            let mut share = (share.x + share.y + share.z) * (1.0 / 3.0);
            if *coat {
                share *= schlick(Vec3::splat(COAT), -ray.dir.dot(normal)).x;
            }
            // Where the number lies in the interval of the part that it chose is a number for the mixes in that part
            let second = number < share;
            number = if second { number / share } else { ((number - share) / (1.0 - share)).min(BELOW_1) };
            material = &self.materials[parts[usize::from(second)] as usize];
            if material.relief.is_some() {
                relief = &material.relief;
            }
        }
        if let Some(relief) = relief {
            let shiny = !matches!(material.bsdf, Bsdf::Diffuse { .. });
            normal = self.relieved(relief, hit, ray.dir, Sides { flat, normal, front, uv, shiny });
        }
        let along = if material.directional { self.growing_u(hit, flat) } else { Vec3::ZERO };
        let light = if group.light == NO { NO } else { group.light + prim - group.first };
        Intersection { position, flat, normal, front, uv, along, tint, material, light, offset }
    }

    /// The shading normal of a surface with relief, on the side of the ray's origin.
    #[cold]
    #[inline(never)]
    fn relieved(&self, relief: &Relief, hit: &Hit, dir: Vec3, sides: Sides) -> Vec3 {
        let Sides { flat, normal, front, uv, shiny } = sides;
        // Relief is that of the front; from behind its bumps are dents
        let sign = if front { 1.0 } else { -1.0 };
        let given = if relief.is_of_normals() { self.given_tangents(hit, normal * sign) } else { None };
        let along = given.or_else(|| self.tangents(hit, flat * sign, relief.is_second()));
        match along.and_then(|along| relief.turned(normal * sign, along, uv)) {
            Some(turned) => relief::bent(turned * sign, flat, -dir, shiny),
            None => normal,
        }
    }

    /// How the position grows with u; 0 where texture coordinates do not span the surface.
    #[cold]
    #[inline(never)]
    fn growing_u(&self, hit: &Hit, flat: Vec3) -> Vec3 {
        self.tangents(hit, flat, false).map_or(Vec3::ZERO, |[along, _]| along.normalize_or_zero())
    }
}

/// The normals of a surface without its relief, towards the ray's origin.
struct Sides {
    flat: Vec3,
    normal: Vec3,
    front: bool,
    uv: Coordinates,
    shiny: bool,
}

/// Azimuth and polar angle of a sphere's normal, each in 0…1.
#[inline]
fn sphere_coordinates(n: Vec3) -> [f32; 2] {
    use std::f32::consts::{FRAC_1_PI, PI};
    let polar = n.y.clamp(-1.0, 1.0).acos() * FRAC_1_PI;
    [(n.z.atan2(n.x) + PI) * 0.5 * FRAC_1_PI, 1.0 - polar]
}

impl<'a> Intersection<'a> {
    /// The origin of a ray that leaves it on the side that `dir` points to.
    #[inline]
    pub(crate) fn leave(&self, dir: Vec3) -> Vec3 {
        let distance = (self.position.abs().max_element() * OFFSET).max(self.offset);
        let side = if dir.dot(self.flat) < 0.0 { -distance } else { distance };
        self.position + self.flat * side
    }

    /// The frame in which directions of scattering are local.
    #[inline]
    pub(crate) fn frame(&self) -> Frame {
        if self.along == Vec3::ZERO { Frame::new(self.normal) } else { Frame::along(self.normal, self.along) }
    }

    /// Its microfacets and coat, seen at a cosine with the shading normal; `None` if it has none.
    #[inline]
    pub(crate) fn glossy(&self, cos: f32) -> Option<Glossy<'a>> {
        let facets = |own| self.material.facets(own, self.uv);
        match &self.material.bsdf {
            Bsdf::Metal { fresnel, colour, ggx } => {
                Some(Glossy::metal(fresnel, colour.tinted(self.uv, self.tint), facets(*ggx)))
            }
            Bsdf::Plastic { diffuse, specular, ggx, nonlinear, coat } => {
                let diffuse = diffuse.tinted(self.uv, self.tint);
                Some(Glossy::plastic(coat, diffuse, *specular, facets(*ggx), *nonlinear, cos))
            }
            Bsdf::Gltf { base, metallic_roughness, f0 } => {
                let values = metallic_roughness.at(self.uv);
                let alpha = (values.y * values.y).max(MIN_ROUGHNESS);
                Some(Glossy::gltf(base.tinted(self.uv, self.tint), alpha, values.z, *f0, cos))
            }
            Bsdf::Principled { base, metallic_roughness, more } => {
                let values = metallic_roughness.at(self.uv);
                let base = base.tinted(self.uv, self.tint);
                Some(Glossy::principled(more, base, [values.y, values.z], cos))
            }
            Bsdf::Lobes { diffuse, through, specular, mirror, gloss, oren_nayar, ggx } => {
                let [diffuse, through, specular, mirror] =
                    [diffuse, through, specular, mirror].map(|colour| colour.tinted(self.uv, self.tint));
                let (gloss, oren_nayar, ggx) = (*gloss, *oren_nayar, facets(*ggx));
                let lobes = LobesAt { diffuse, through, specular, mirror, gloss, oren_nayar, ggx };
                Some(Glossy::lobes(lobes, cos))
            }
            _ => None,
        }
    }

    /// Whether a direction `dir`, `wi` in the frame of the shading normal, is on the same side of both normals. A
    /// shading normal must not carry light through the surface that it reflects, or the other way round.
    #[inline]
    pub(crate) fn is_consistent(&self, dir: Vec3, wi: Vec3) -> bool {
        (dir.dot(self.flat) > 0.0) == (wi.z > 0.0)
    }

    /// The same surface seen from behind.
    pub(crate) fn turned_over(&self) -> Self {
        Self { flat: -self.flat, normal: -self.normal, front: !self.front, ..*self }
    }

    /// Its rough boundary, seen from the ray's side; `None` if it is something else.
    #[inline]
    pub(crate) fn rough_glass(&self) -> Option<RoughGlass> {
        let Bsdf::RoughGlass { ior, tint, ggx } = &self.material.bsdf else { return None };
        let eta = if self.front { *ior } else { 1.0 / ior };
        Some(RoughGlass::new(self.material.facets(*ggx, self.uv), eta, *tint))
    }
}

// How a surface runs along its texture coordinates.

impl Scene {
    /// The derivatives of the position by u and v where a ray hit; none where texture coordinates do not span
    /// the surface.
    /// `normal` is the geometric one of the front; `second` says of which texture coordinates.
    pub(crate) fn tangents(&self, hit: &Hit, normal: Vec3, second: bool) -> Option<[Vec3; 2]> {
        let Some(instance) = self.bvh.instance(hit) else {
            return self.local_tangents(hit, normal, second);
        };
        let along = self.local_tangents(hit, instance.local_normal(normal), second)?;
        Some(along.map(|edge| instance.edge(edge)))
    }

    /// The tangent of the mesh where a ray hit, and the bitangent; none if it has none. `normal` is the
    /// shading normal of the front.
    pub(crate) fn given_tangents(&self, hit: &Hit, normal: Vec3) -> Option<[Vec3; 2]> {
        let (prim, _) = self.bvh.shape_at::<true>(hit);
        let group = self.geometry.group(prim);
        if group.tangents == NO {
            return None;
        }
        let instance = self.bvh.instance(hit);
        let normal = instance.map_or(normal, |instance| instance.local_normal(normal));
        let (tangent, side) = self.geometry.tangent(group, prim, hit.uv);
        // glTF 2.0, §3.7.2.1
        let along = [tangent, normal.cross(tangent) * side];
        Some(along.map(|edge| instance.map_or(edge, |instance| instance.edge(edge))))
    }

    /// The same in the coordinates of the object that was hit.
    fn local_tangents(&self, hit: &Hit, normal: Vec3, second: bool) -> Option<[Vec3; 2]> {
        let (prim, shape) = self.bvh.shape_at::<true>(hit);
        let group = self.geometry.group(prim);
        match (shape, self.bvh.edges(hit)) {
            (HitShape::Sphere { radius, .. }, _) => Some(self.around(group, radius, normal)),
            (HitShape::Plane { .. }, Some(edges)) => {
                let [a, b] = self.geometry.texture_steps(group, prim, hit.uv, second);
                // [e1 e2] = [dp/du dp/dv]·[a b], solved for the derivatives
                let determinant = a[0] * b[1] - b[0] * a[1];
                let inverse = determinant.recip();
                let along = [
                    (edges[0] * b[1] - edges[1] * a[1]) * inverse,
                    (edges[1] * a[0] - edges[0] * b[0]) * inverse,
                ];
                along.iter().all(|d| d.is_finite()).then_some(along)
            }
            _ => None,
        }
    }

    /// Along azimuth and polar angle of a sphere, with `normal` the one of its outside.
    fn around(&self, group: &Group, radius: f32, normal: Vec3) -> [Vec3; 2] {
        let [x, y, z] =
            self.geometry.frames.get(group.frame as usize).copied().unwrap_or([Vec3::X, Vec3::Y, Vec3::Z]);
        let along_u = z * normal.dot(x) - x * normal.dot(z);
        let along_v = (y - normal * normal.dot(y)).normalize_or_zero();
        [along_u * (2.0 * PI * radius), along_v * (PI * radius)]
    }
}

impl crate::geometry::Geometry {
    /// By how much texture coordinates grow along each edge of a planar surface of `group`, at `at` on it.
    fn texture_steps(&self, group: &Group, prim: u32, [u, v]: [f32; 2], second: bool) -> [[f32; 2]; 2] {
        let uvs = if second && group.second_uvs != NO { group.second_uvs } else { group.uvs };
        if uvs == NO {
            let turn = match group.frame {
                RINGS => -0.5 / PI,
                RINGS_REVERSED => 0.5 / PI,
                _ => return [[1.0, 0.0], [0.0, 1.0]],
            };
            // The radius √(a² + b²) and the angle atan2(b, a), at (a, b)
            let (r2, r) = (u * u + v * v, (u * u + v * v).sqrt());
            return [[u / r, -v / r2 * turn], [v / r, u / r2 * turn]];
        }
        let corners = self.vertices.corners[(group.corners + prim - group.first) as usize];
        let [a, b, c] = corners.map(|i| self.vertices.uvs[(uvs + i) as usize]);
        [[b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]]
    }
}
