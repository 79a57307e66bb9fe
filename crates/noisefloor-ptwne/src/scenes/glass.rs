//! Mirrors, glass and caustics.

use super::kit::{Kit, emission, look_at};
use crate::{Material, Scene, SceneError};

/// Balls of glass and mirror in a box, with caustics.
pub(super) fn caustics(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.0, 1.25, 4.35], [0.0, 0.92, 0.0], 36.5))?;
    let white = k.diffuse([0.74, 0.73, 0.70])?;
    let floor = k.checker([[0.70, 0.68, 0.62], [0.30, 0.29, 0.30]], [2.5, 2.5])?;
    let (ochre, teal) = (k.diffuse([0.66, 0.42, 0.13])?, k.diffuse([0.10, 0.36, 0.42])?);
    let glass = k.material(Material::Glass { ior: 1.5, tint: [0.98, 0.99, 0.98] })?;
    let amber = k.material(Material::Glass { ior: 1.45, tint: [0.95, 0.66, 0.30] })?;
    let mirror = k.material(Material::Mirror { reflectance: [0.9; 3] })?;
    let (x, z) = ([-1.4, 1.4], [-1.2, 4.8]);

    k.floor(0.0, x, z, true, floor, None);
    k.floor(2.2, x, z, false, white, None);
    k.wall([-1.4, -1.2], [1.4, -1.2], [0.0, 2.2], white);
    k.wall([-1.4, 4.8], [-1.4, -1.2], [0.0, 2.2], ochre);
    k.wall([1.4, -1.2], [1.4, 4.8], [0.0, 2.2], teal);
    k.wall([1.4, 4.8], [-1.4, 4.8], [0.0, 2.2], white);
    k.ball([-0.62, 0.52, -0.35], 0.52, mirror, None);
    k.ball([0.52, 0.46, 0.22], 0.46, glass, None);
    k.ball([-0.28, 0.22, 0.62], 0.22, amber, None);
    k.turned([0.78, 0.0, -0.72], [0.5, 1.1, 0.5], -20.0, white);
    k.ball([0.78, 1.38, -0.72], 0.28, glass, None);
    k.floor(2.195, [-0.3, 0.3], [-0.25, 0.25], false, white, emission([19.0, 17.5, 15.0]));
    k.build()
}

/// Plates of increasing roughness that reflect lights of increasing size (after Veach, Guibas 1995).
pub(super) fn plates(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.0, 2.6, 8.6], [0.0, 1.35, 0.0], 32.0))?;
    let wall = k.diffuse([0.42, 0.42, 0.44])?;
    let tiles = k.checker([[0.34, 0.34, 0.36], [0.22, 0.22, 0.24]], [1.5, 1.5])?;
    let black = k.diffuse([0.0; 3])?;
    k.floor(0.0, [-9.0, 9.0], [-2.4, 9.5], true, tiles, None);
    k.wall([-9.0, -2.4], [9.0, -2.4], [0.0, 7.0], wall);

    // Each plate is turned so that its middle mirrors the lights into the camera
    let (eye, lights) = ([2.6f32, 8.6f32], [3.1f32, -0.6f32]);
    for (i, roughness) in [0.02, 0.06, 0.14, 0.30].into_iter().enumerate() {
        let metal = k.metal([0.86, 0.86, 0.88], roughness)?;
        let [y, z] = [[1.62, -1.25], [1.02, -0.35], [0.56, 0.75], [0.24, 2.0]][i];
        let unit = |[a, b]: [f32; 2]| {
            let length = a.hypot(b);
            [a / length, b / length]
        };
        let (to_eye, to_light) = (unit([eye[0] - y, eye[1] - z]), unit([lights[0] - y, lights[1] - z]));
        let [ny, nz] = unit([to_eye[0] + to_light[0], to_eye[1] + to_light[1]]);
        // The edge perpendicular to the normal, in the plane x = 0
        let edge = [0.0, -nz * 0.86, ny * 0.86];
        k.quad([-2.1, y - 0.5 * edge[1], z - 0.5 * edge[2]], edge, [4.2, 0.0, 0.0], metal, None);
    }
    // The same power from each ball
    for (x, radius, colour) in [
        (-1.75, 0.04, [1.0, 0.75, 0.55]),
        (-0.65, 0.12, [0.75, 1.0, 0.7]),
        (0.55, 0.26, [0.6, 0.8, 1.0]),
        (1.85, 0.42, [0.95, 0.7, 1.0]),
    ] {
        let strength = 0.42 / (radius * radius);
        k.ball([x, lights[0], lights[1]], radius, black, emission(colour.map(|c: f32| c * strength)));
    }
    k.floor(6.5, [-3.0, 3.0], [3.0, 6.0], false, black, emission([1.1; 3]));
    k.build()
}
