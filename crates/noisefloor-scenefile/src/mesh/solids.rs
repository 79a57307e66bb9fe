//! Curved and simple solids as triangles.

use super::Triangles;
use crate::error::{LoadError, Place};
use crate::load::Load;
use glam::{DMat3, DMat4, DQuat, DVec2, DVec3, Vec3};
use noisefloor_ptwne::{MaterialId, ObjectId, SceneBuilder};
use std::collections::HashMap;
use std::f32::consts::{PI, TAU};

/// Triangles around a circle, and from pole to pole of a sphere.
const AROUND: u32 = 128;
const ALONG: u32 = 64;

/// The square from −1 to 1 in x and y; its front is +z.
pub(crate) fn rectangle() -> Triangles {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    Triangles {
        positions: corners.map(|[x, y]| [x, y, 0.0]).to_vec(),
        normals: vec![[0.0, 0.0, 1.0]; 4],
        uvs: corners.map(|corner| corner.map(|x| 0.5 * x + 0.5)).to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
        ..Triangles::default()
    }
}

/// The cube from −1 to 1, with a whole texture on each side.
pub(crate) fn cube() -> Triangles {
    // Of each side: where u and v run to; the front is v × u
    let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z];
    let mut mesh = Triangles::default();
    for (u, v) in [(z, x), (-x, -z), (y, -z), (y, x), (y, z), (-y, x)] {
        let first = mesh.positions.len() as u32;
        let front = v.cross(u);
        for [s, t] in [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]] {
            mesh.positions.push((front + u * (2.0 * s - 1.0) + v * (2.0 * t - 1.0)).to_array());
            mesh.normals.push(front.to_array());
            mesh.uvs.push([s, t]);
        }
        mesh.indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    mesh
}

/// A sphere of radius 1 around the origin. u runs around z from +x over +y, v from +z at 0 to −z at 1.
pub(crate) fn sphere() -> Triangles {
    grid(ALONG, |u, v| {
        let (sin, cos) = (PI * v).sin_cos();
        let (y, x) = (TAU * u).sin_cos();
        let normal = [sin * x, sin * y, cos];
        (normal, normal)
    })
}

/// Spheres of radius 1 around the origin that the ellipsoids of a material share.
#[derive(Debug, Default)]
pub(crate) struct Balls(HashMap<MaterialId, ObjectId>);

impl Balls {
    /// Adds such a sphere, moved; one that is singular is left out, with a warning.
    pub(crate) fn add(
        &mut self,
        load: &Load,
        builder: &mut SceneBuilder,
        material: MaterialId,
        to_world: DMat4,
        place: &Place,
    ) -> Result<(), LoadError> {
        let object = match self.0.get(&material) {
            Some(object) => *object,
            None => {
                let refused = place.refused();
                builder.begin_object().map_err(&refused)?;
                let axes = [-Vec3::X, Vec3::Z, -Vec3::Y].map(|axis| axis.to_array());
                builder.turned_sphere([0.0; 3], 1.0, axes, material, None).map_err(&refused)?;
                let object = builder.end_object().map_err(&refused)?;
                self.0.insert(material, object);
                object
            }
        };
        load.instance(builder, object, to_world, "a sphere", place).map(drop)
    }
}

/// A sphere as the renderer takes it: with axes of its texture coordinates, which run as pbrt's and Mitsuba's: u around z
/// from +x over +y, v = 1 at +z.
#[derive(Debug)]
pub(crate) struct Ball {
    pub(crate) centre: [f32; 3],
    pub(crate) radius: f32,
    pub(crate) axes: [[f32; 3]; 3],
}

/// A sphere around `centre`, moved; none if that stretches or shears it.
pub(crate) fn ball(to_world: DMat4, centre: DVec3, radius: f64) -> Option<Ball> {
    let axes = DMat3::from_mat4(to_world);
    let scale = axes.x_axis.length();
    // To what six digits in a file leave of a rotation
    let off = (axes.transpose() * axes - DMat3::IDENTITY * (scale * scale)).to_cols_array();
    let even = off.iter().all(|x| x.abs() <= 1e-4 * scale * scale) && scale > 0.0;
    let centre = to_world.transform_point3(centre).as_vec3().to_array();
    let [x, y, z] = [axes.x_axis, axes.y_axis, axes.z_axis].map(|axis| (axis / scale).as_vec3());
    let axes = [-x, z, -y].map(|axis| axis.to_array());
    even.then_some(Ball { centre, radius: (radius * scale) as f32, axes })
}

/// The open cylinder of radius 1 around z, from z = 0 to z = 1. u runs around z from +x over +y, v along z.
pub(crate) fn cylinder() -> Triangles {
    let mut mesh = grid(1, |u, v| {
        let (y, x) = (TAU * u).sin_cos();
        ([x, y, v], [x, y, 0.0])
    });
    // v runs up: the other way round than on a sphere
    mesh.indices.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    mesh
}

/// What a curve leaves as it turns around z, from azimuth 0 up to `sweep` in radians, as pbrt's quadrics are
/// made. `curve` gives a point at v of 0 to 1, and the direction in which it goes on; the front is that to the
/// right of it as seen along the turn. u runs along the turn. `straight` if the curve is a line in a plane
/// through z.
pub(crate) fn turned(sweep: f64, straight: bool, curve: impl Fn(f64) -> [DVec3; 2]) -> Triangles {
    let along = if straight { 1 } else { ALONG };
    let mut mesh = grid(along, |u, v| {
        let turn = DQuat::from_rotation_z(sweep * f64::from(u));
        let [at, onward] = curve(f64::from(v));
        // On the axis, that of its neighbours
        let around = if at.truncate() == DVec2::ZERO { DVec2::X } else { at.truncate() };
        let normal = around.perp().extend(0.0).cross(onward).normalize_or_zero();
        ((turn * at).as_vec3().to_array(), (turn * normal).as_vec3().to_array())
    });
    mesh.indices.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    mesh
}

/// A grid of `AROUND` by `along` squares with positions and normals as functions of (u, v).
fn grid(along: u32, at: impl Fn(f32, f32) -> ([f32; 3], [f32; 3])) -> Triangles {
    let mut mesh = Triangles::default();
    for j in 0..=along {
        for i in 0..=AROUND {
            let (u, v) = (i as f32 / AROUND as f32, j as f32 / along as f32);
            let (position, normal) = at(u, v);
            mesh.positions.push(position);
            mesh.normals.push(normal);
            mesh.uvs.push([u, v]);
        }
    }
    let row = AROUND + 1;
    for j in 0..along {
        for i in 0..AROUND {
            let a = j * row + i;
            mesh.indices.extend([[a, a + row, a + row + 1], [a, a + row + 1, a + 1]]);
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners run counter-clockwise as seen from where the normals point, and all fits together.
    #[test]
    fn fronts_are_outside() {
        // A cap of height 1/2, a cone, a paraboloid and a hyperboloid that is a cylinder, of parts of a turn
        let cap = turned(PI.into(), false, |v| {
            let (sin, cos) = (f64::from(PI) / 3.0 * (1.0 - v)).sin_cos();
            [DVec3::new(sin, 0.0, cos), DVec3::new(-cos, 0.0, sin)]
        });
        let cone = turned(TAU.into(), true, |v| [DVec3::new(1.0 - v, 0.0, v), DVec3::new(-1.0, 0.0, 1.0)]);
        let bowl = turned(1.0, false, |v| [DVec3::new(v, 0.0, v * v), DVec3::new(1.0, 0.0, 2.0 * v)]);
        let ring = turned(TAU.into(), true, |v| [DVec3::new(1.0 - 0.5 * v, 0.0, 0.0), DVec3::NEG_X]);
        let tube = turned(2.0, true, |v| [DVec3::new(0.6, 0.8, v), DVec3::Z]);
        for (mesh, area) in [
            (cap, PI * 0.5),
            (cone, PI * 2f32.sqrt()),
            (bowl, (5f32.powf(1.5) - 1.0) / 12.0),
            (tube, 2.0),
            (sphere(), 4.0 * PI),
            (cylinder(), TAU),
            (cube(), 24.0),
            (rectangle(), 4.0),
            (ring, 0.75 * PI),
        ] {
            let mut sum = 0.0;
            for triangle in &mesh.indices {
                let [a, b, c] = triangle.map(|i| Vec3::from(mesh.positions[i as usize]));
                let normal: Vec3 = triangle.iter().map(|i| Vec3::from(mesh.normals[*i as usize])).sum();
                let cross = (b - a).cross(c - a);
                assert!(cross.dot(normal) > -1e-6, "{triangle:?}");
                sum += 0.5 * cross.length();
            }
            assert!((sum / area - 1.0).abs() < 2e-3, "{sum} {area}");
        }
    }
}
