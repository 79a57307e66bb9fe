//! Halls: an arcade of brick and checkers, and a market under many lanterns.

use super::kit::{Kit, emission, look_at};
use crate::{Environment, Scene, SceneError, Sun};

/// A hall with two arcades and an open roof: the sun falls in from above.
pub(super) fn arcade(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.35, 1.7, 8.6], [-0.25, 2.1, 0.0], 55.0))?;
    let floor = k.checker([[0.58, 0.54, 0.47], [0.24, 0.20, 0.18]], [1.0, 1.0])?;
    let brick = k.brick([[0.58, 0.33, 0.22], [0.60, 0.57, 0.52]], [1.7, 4.0])?;
    let plaster = k.noise([[0.58, 0.50, 0.40], [0.76, 0.69, 0.58]], [1.1, 1.1])?;
    let marble = k.noise([[0.52, 0.48, 0.43], [0.78, 0.74, 0.68]], [6.0, 1.2])?;
    let cloths = [[0.55, 0.08, 0.07], [0.09, 0.22, 0.45], [0.12, 0.34, 0.14]];
    let cloths = [k.diffuse(cloths[0])?, k.diffuse(cloths[1])?, k.diffuse(cloths[2])?];
    let bronze = k.metal([0.70, 0.50, 0.28], 0.25)?;

    k.sky(Environment {
        zenith: [0.42, 0.66, 1.2],
        horizon: [0.95, 1.1, 1.3],
        ground: [0.3, 0.28, 0.25],
        sun: Some(Sun {
            direction: [0.42, 1.0, 0.16],
            angular_radius: 0.8,
            radiance: [5200.0, 4500.0, 3500.0],
        }),
    });
    k.floor(0.0, [-5.0, 5.0], [-10.0, 10.0], true, floor, None);
    // Outer walls, galleries over the aisles, walls above them
    for side in [-1.0f32, 1.0] {
        let x = |a: f32, b: f32| if side < 0.0 { [-b, -a] } else { [a, b] };
        let slab = |k: &mut Kit, a: f32, b: f32, y: [f32; 2], m| {
            let [x0, x1] = x(a, b);
            k.cuboid([x0, y[0], -10.0], [x1, y[1], 10.0], m);
        };
        slab(&mut k, 5.0, 5.4, [0.0, 7.0], brick);
        slab(&mut k, 2.2, 5.0, [3.6, 3.9], plaster);
        slab(&mut k, 2.2, 2.6, [3.2, 3.6], plaster);
        slab(&mut k, 2.3, 2.5, [3.9, 4.6], brick);
        slab(&mut k, 3.6, 5.4, [6.4, 6.7], plaster);
        let column = [
            [0.34, 0.0],
            [0.34, 0.2],
            [0.26, 0.28],
            [0.24, 0.34],
            [0.21, 2.6],
            [0.25, 2.7],
            [0.36, 2.95],
            [0.36, 3.2],
        ];
        let slim = [[0.2, 0.0], [0.13, 0.1], [0.11, 1.55], [0.2, 1.7], [0.2, 1.8]];
        for i in 0..8 {
            let z = -8.75 + 2.5 * i as f32;
            k.lathe([side * 2.4, 0.0, z], &column, 28, false, marble);
            k.lathe([side * 2.4, 4.6, z], &slim, 20, false, marble);
            k.cuboid([x(4.75, 5.0)[0], 0.0, z - 0.25], [x(4.75, 5.0)[1], 3.6, z + 0.25], plaster);
            if i % 2 == 1 {
                let cloth = cloths[(i / 2 + usize::from(side > 0.0)) % 3];
                k.quad([side * 2.28, 1.9, z + 0.75], [0.0, 0.0, 1.0], [0.0, 1.9, 0.0], cloth, None);
            }
        }
        slab(&mut k, 2.2, 2.6, [6.4, 6.8], plaster);
    }
    k.cuboid([-5.0, 0.0, -10.4], [5.0, 7.0, -10.0], brick);
    k.cuboid([-5.0, 0.0, 10.0], [5.0, 7.0, 10.4], brick);
    k.cuboid([-0.9, 0.0, -10.02], [0.9, 2.9, -9.98], cloths[0]);
    // Urns along the nave
    let urn = [
        [0.0, 0.0],
        [0.3, 0.0],
        [0.3, 0.3],
        [0.14, 0.4],
        [0.32, 0.75],
        [0.34, 0.95],
        [0.2, 1.1],
        [0.26, 1.2],
        [0.0, 1.1],
    ];
    for (x, z) in [(-1.35, 1.2), (1.35, 1.2), (-1.35, -4.0), (1.35, -4.0)] {
        k.lathe([x, 0.0, z], &urn, 36, true, bronze);
    }
    k.build()
}

/// A market street at night, under more than a hundred lanterns of many colours.
pub(super) fn lanterns(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.1, 1.8, 7.0], [0.0, 1.55, 0.0], 46.0))?;
    let cobbles = k.brick([[0.42, 0.40, 0.39], [0.20, 0.19, 0.18]], [2.6, 4.0])?;
    let brick = k.brick([[0.60, 0.38, 0.28], [0.55, 0.45, 0.42]], [2.0, 4.5])?;
    let plaster = k.diffuse([0.62, 0.56, 0.46])?;
    let wood = k.diffuse([0.36, 0.22, 0.12])?;
    let dark = k.diffuse([0.05, 0.05, 0.06])?;
    let awnings =
        [k.diffuse([0.62, 0.14, 0.10])?, k.diffuse([0.66, 0.60, 0.48])?, k.diffuse([0.12, 0.30, 0.36])?];
    let fruit =
        [k.diffuse([0.70, 0.30, 0.04])?, k.diffuse([0.55, 0.06, 0.05])?, k.diffuse([0.28, 0.42, 0.08])?];
    let copper = k.metal([0.90, 0.58, 0.44], 0.2)?;

    k.sky(Environment {
        zenith: [0.006, 0.01, 0.028],
        horizon: [0.02, 0.024, 0.045],
        ground: [0.0; 3],
        sun: None,
    });
    k.floor(0.0, [-4.0, 4.0], [-12.0, 9.0], true, cobbles, None);
    k.cuboid([-4.4, 0.0, -12.0], [-3.2, 5.0, 9.0], brick);
    k.cuboid([3.2, 0.0, -12.0], [4.4, 5.0, 9.0], plaster);
    k.cuboid([-3.2, 0.0, -12.4], [3.2, 4.2, -12.0], brick);
    for i in 0..5 {
        let z = -9.0 + 3.0 * i as f32;
        for side in [-1.0f32, 1.0] {
            // A stall: counter, posts, awning, fruit; a window above
            let pick = i + usize::from(side > 0.0);
            k.cuboid([side * 2.55 - 0.6, 0.0, z - 0.9], [side * 2.55 + 0.6, 0.8, z + 0.9], wood);
            for dz in [-0.85, 0.8] {
                k.cuboid([side * 2.0 - 0.03, 0.8, z + dz], [side * 2.0 + 0.03, 2.1, z + dz + 0.06], wood);
            }
            let drop = [-side * 1.5, -0.5, 0.0];
            k.quad([side * 3.2, 2.6, z - 1.0], [0.0, 0.0, 2.0], drop, awnings[pick % 3], None);
            for f in 0..24 {
                let (row, column) = ((f / 6) as f32, (f % 6) as f32);
                let at = [side * (2.15 + 0.2 * row), 0.88 + 0.05 * row, z - 0.6 + 0.24 * column];
                k.ball(at, 0.1, fruit[(pick + f / 12) % 3], None);
            }
            k.cuboid([side * 3.2 - 0.02, 3.0, z - 0.45], [side * 3.2 + 0.02, 4.1, z + 0.45], dark);
        }
    }
    let kettle = [
        [0.0, 0.0],
        [0.4, 0.0],
        [0.55, 0.2],
        [0.58, 0.45],
        [0.4, 0.75],
        [0.12, 0.85],
        [0.1, 0.95],
        [0.0, 0.97],
    ];
    k.lathe([-0.9, 0.0, 1.6], &kettle, 48, true, copper);
    k.turned([1.0, 0.0, 0.2], [0.7, 0.6, 0.7], 28.0, wood);
    k.turned([1.05, 0.6, 0.2], [0.5, 0.45, 0.5], -10.0, wood);

    // Lanterns on sagging strings across the street
    let colours =
        [[1.0, 0.62, 0.28], [1.0, 0.42, 0.18], [0.95, 0.85, 0.6], [0.35, 0.75, 0.9], [0.95, 0.35, 0.45]];
    for string in 0..12 {
        let z = -11.0 + 1.45 * string as f32;
        for i in 0..10 {
            let t = (i as f32 + 0.5) / 10.0;
            let y = 3.35 - 2.2 * t * (1.0 - t) + 0.25 * ((string * 7 % 5) as f32 / 5.0 - 0.4);
            let colour = colours[(i * 3 + string * 2) % 5].map(|c: f32| c * 9.0);
            k.ball([-3.1 + 6.2 * t, y, z + 0.3 * (t - 0.5)], 0.1, dark, emission(colour));
        }
    }
    k.build()
}
