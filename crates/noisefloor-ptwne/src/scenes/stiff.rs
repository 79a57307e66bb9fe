//! Scenes that are hard for a renderer, each for one reason: light that light sampling cannot find, numbers
//! that f32 cannot hold, and divisions by zero.

use super::kit::{Kit, P, emission, look_at};
use crate::{Environment, Material, Mesh, Scene, SceneError, Sun};
use std::f32::consts::PI;

/// A glass ball and a glass block between a small lamp and the floor. Only scattered rays find the lamp
/// through glass.
pub(super) fn caustic(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.3, 1.9, 4.2], [0.1, 0.45, 0.0], 36.0))?;
    let paper = k.diffuse([0.7, 0.68, 0.64])?;
    let slate = k.diffuse([0.2, 0.22, 0.25])?;
    let black = k.diffuse([0.0; 3])?;
    let glass = k.material(Material::Glass { ior: 1.5, tint: [0.99; 3] })?;
    let green = k.material(Material::Glass { ior: 1.7, tint: [0.7, 0.95, 0.75] })?;
    k.floor(0.0, [-4.0, 4.0], [-1.6, 6.0], true, paper, None);
    k.wall([-4.0, -1.6], [4.0, -1.6], [0.0, 4.0], slate);
    k.ball([-0.25, 0.75, 0.0], 0.45, glass, None);
    k.turned([0.95, 0.3, 0.3], [0.4, 0.5, 0.4], 30.0, green);
    k.ball([-2.0, 3.0, 0.6], 0.03, black, emission([9000.0, 8400.0, 7500.0]));
    k.build()
}

/// A dark room beside a bright one, joined by a keyhole of 6×12 cm. Nearly all shadow rays to the lamp are
/// blocked.
pub(super) fn keyhole(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([1.5, 1.3, 3.4], [-0.35, 0.8, 0.0], 48.0))?;
    let wall = k.diffuse([0.75, 0.73, 0.70])?;
    let boards = k.noise([[0.34, 0.22, 0.13], [0.52, 0.36, 0.22]], [1.2, 14.0])?;
    let door = k.diffuse([0.40, 0.25, 0.14])?;
    let (red, blue) = (k.diffuse([0.62, 0.13, 0.09])?, k.diffuse([0.14, 0.27, 0.52])?);
    let black = k.diffuse([0.0; 3])?;

    // The room, x −2…2, z −1…4, and the wall of thickness zero at z = −1
    k.floor(0.0, [-2.0, 2.0], [-1.0, 4.0], true, boards, None);
    k.floor(2.5, [-2.0, 2.0], [-1.0, 4.0], false, wall, None);
    k.wall([-2.0, 4.0], [-2.0, -1.0], [0.0, 2.5], wall);
    k.wall([2.0, -1.0], [2.0, 4.0], [0.0, 2.5], wall);
    k.wall([2.0, 4.0], [-2.0, 4.0], [0.0, 2.5], wall);
    k.wall([-2.0, -1.0], [-0.45, -1.0], [0.0, 2.5], wall);
    k.wall([0.45, -1.0], [2.0, -1.0], [0.0, 2.5], wall);
    k.wall([-0.45, -1.0], [0.45, -1.0], [2.0, 2.5], wall);
    // The door in it; its keyhole is x 0.28…0.34, y 1.0…1.12
    k.wall([-0.45, -1.0], [0.28, -1.0], [0.0, 2.0], door);
    k.wall([0.34, -1.0], [0.45, -1.0], [0.0, 2.0], door);
    k.wall([0.28, -1.0], [0.34, -1.0], [0.0, 1.0], door);
    k.wall([0.28, -1.0], [0.34, -1.0], [1.12, 2.0], door);
    // The lamp: a panel in the next room
    let lamp = emission([1600.0, 1450.0, 1200.0]);
    k.quad([-0.19, 0.56, -1.4], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], black, lamp);

    k.turned([-0.9, 0.0, 0.4], [0.6, 0.6, 0.6], 25.0, blue);
    k.ball([0.35, 0.3, 0.9], 0.3, red, None);
    k.turned([-1.4, 0.0, -0.5], [0.5, 1.4, 0.5], 0.0, wall);
    k.build()
}

/// A still life under a lamp of radius 1e-4.
pub(super) fn pinpoint(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.0, 1.6, 4.2], [0.0, 0.6, 0.0], 38.0))?;
    let floor = k.checker([[0.62, 0.60, 0.55], [0.34, 0.32, 0.30]], [2.0, 2.0])?;
    let white = k.diffuse([0.75; 3])?;
    let orange = k.diffuse([0.70, 0.34, 0.10])?;
    let brass = k.metal([0.90, 0.68, 0.34], 0.2)?;
    let black = k.diffuse([0.0; 3])?;
    k.floor(0.0, [-4.0, 4.0], [-1.5, 6.0], true, floor, None);
    k.wall([-4.0, -1.5], [4.0, -1.5], [0.0, 4.0], white);
    k.turned([-0.9, 0.0, -0.2], [0.6, 0.9, 0.6], 25.0, white);
    k.ball([0.05, 0.4, 0.3], 0.4, orange, None);
    k.ball([0.95, 0.45, -0.2], 0.45, brass, None);
    // An intensity of about 17: that of a ball is πr² times its radiance
    k.ball([-0.4, 2.6, 1.4], 1e-4, black, emission([6e8, 5.6e8, 5e8]));
    k.build()
}

/// Nine niches in a wall, each lit by a panel of its own. The radiance of the panels goes from 1e-8 to 1e8 in
/// steps of 100.
pub(super) fn decades(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.0, 0.0, 7.0], [0.0, 0.0, 0.0], 28.0))?;
    let grey = k.diffuse([0.6; 3])?;
    let black = k.diffuse([0.0; 3])?;
    for i in 0..9 {
        // A niche of 1×1 and 0.6 deep, from the top left; its light reaches no other niche
        let (x, y) = (1.1 * ((i % 3) as f32 - 1.0), 1.1 * (1.0 - (i / 3) as f32));
        let (low, high) = ([x - 0.5, y - 0.5], [x + 0.5, y + 0.5]);
        k.quad([low[0], low[1], -0.6], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], grey, None);
        k.wall([low[0], 0.0], [low[0], -0.6], [low[1], high[1]], grey);
        k.wall([high[0], -0.6], [high[0], 0.0], [low[1], high[1]], grey);
        k.floor(low[1], [low[0], high[0]], [-0.6, 0.0], true, grey, None);
        k.floor(high[1], [low[0], high[0]], [-0.6, 0.0], false, grey, None);
        let light = emission([10f32.powi(2 * i - 8); 3]);
        k.quad([x - 0.15, y - 0.15, -0.55], [0.3, 0.0, 0.0], [0.0, 0.3, 0.0], black, light);
    }
    k.build()
}

/// Needles a thousand times as long as wide, as a drum around a bright lamp that must not shine through, and
/// sheets of paper that are nearly parallel and nearly touch.
pub(super) fn needles(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.2, 1.5, 4.4], [0.0, 0.55, 0.0], 36.0))?;
    let floor = k.diffuse([0.45, 0.43, 0.40])?;
    let teal = k.diffuse([0.12, 0.42, 0.46])?;
    let (paper, ink) = (k.diffuse([0.8, 0.78, 0.72])?, k.diffuse([0.25, 0.1, 0.1])?);
    let black = k.diffuse([0.0; 3])?;
    k.floor(0.0, [-4.0, 4.0], [-2.0, 6.0], true, floor, None);
    k.wall([-4.0, -2.0], [4.0, -2.0], [0.0, 4.0], paper);

    // A drum of 8000 upright needles, 1 long and 1e-3 wide, between lids, and a cone of 500 slanted ones
    k.lathe([-0.75, 0.0, 0.0], &[[0.6, 0.0], [0.6, 1.0]], 4000, false, teal);
    k.floor(1.0, [-1.4, -0.1], [-0.65, 0.65], false, paper, None);
    k.ball([-0.75, 0.5, 0.0], 0.2, black, emission([1000.0; 3]));
    k.lathe([-0.75, 1.0, 0.0], &[[0.5, 0.0], [0.0, 0.5]], 500, false, ink);
    // Each sheet is 1e-4 above the last at one edge, and 1e-6 at the other
    for i in 0..24 {
        let (low, high) = (0.3 + 1e-6 * i as f32, 0.3 + 1e-4 * i as f32);
        let sheet = if i % 2 == 0 { paper } else { ink };
        let inset = 0.015 * i as f32;
        k.quad([0.4 + inset, low, 0.7], [1.0, high - low, 0.0], [0.0, 0.0, -1.0], sheet, None);
    }
    k.turned([0.9, 0.0, 0.2], [0.8, 0.29, 0.8], 0.0, ink);
    k.quad([-1.5, 3.5, 2.5], [3.0, 0.0, 0.0], [0.0, 0.0, 1.5], black, emission([9.0, 8.6, 8.0]));
    k.build()
}

/// The position of [`far_away`].
const FAR: P = [998_000.0, -999_000.0, 997_000.0];

/// Columns and a ball, hundreds of units large and a million units from the origin, where f32 resolves
/// positions to 1/16.
pub(super) fn far_away(name: &str) -> Result<Scene, SceneError> {
    let at = |p: P| [FAR[0] + p[0], FAR[1] + p[1], FAR[2] + p[2]];
    let mut k = Kit::new(name, look_at(at([250.0, 420.0, 1150.0]), at([0.0, 150.0, 0.0]), 38.0))?;
    let stone = k.diffuse([0.55, 0.52, 0.47])?;
    let red = k.diffuse([0.60, 0.16, 0.10])?;
    let bronze = k.metal([0.72, 0.52, 0.30], 0.2)?;
    let glass = k.material(Material::Glass { ior: 1.5, tint: [0.95, 0.98, 0.97] })?;
    let black = k.diffuse([0.0; 3])?;
    k.sky(Environment {
        zenith: [0.20, 0.28, 0.45],
        horizon: [0.45, 0.48, 0.52],
        ground: [0.4, 0.4, 0.4],
        sun: Some(Sun { direction: [-0.6, 0.7, 0.45], angular_radius: 1.0, radiance: [2600.0; 3] }),
    });
    let [x, y, z] = FAR;
    k.floor(y, [x - 1500.0, x + 1500.0], [z - 1500.0, z + 1500.0], true, stone, None);
    for i in 0..5 {
        k.turned(at([-360.0 + 180.0 * i as f32, 0.0, -260.0]), [70.0, 420.0, 70.0], 9.0 * i as f32, red);
    }
    k.ball(at([-170.0, 110.0, 60.0]), 110.0, bronze, None);
    k.ball(at([140.0, 100.0, 190.0]), 100.0, glass, None);
    let lamp = emission([60.0, 48.0, 30.0]);
    k.quad(at([-400.0, 430.0, -250.0]), [0.0, 0.0, 40.0], [800.0, 0.0, 0.0], black, lamp);
    k.build()
}

/// Hills of a million triangles in one mesh.
pub(super) fn million(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.0, 2.4, 6.4], [0.0, 0.1, 0.0], 38.0))?;
    let earth = k.diffuse([0.46, 0.42, 0.34])?;
    k.sky(Environment {
        zenith: [0.16, 0.27, 0.56],
        horizon: [0.52, 0.60, 0.72],
        ground: [0.42, 0.48, 0.58],
        sun: Some(Sun { direction: [-0.75, 0.35, 0.3], angular_radius: 0.5, radiance: [14000.0; 3] }),
    });
    // 2·708² = 1 002 528 triangles over 8×8 units; heights are a sum of waves that do not repeat
    const SIDE: u32 = 708;
    let at = |i: u32| 8.0 * i as f32 / SIDE as f32 - 4.0;
    let height = |x: f32, z: f32| {
        let wave = |k: i32| {
            let f = 1.9f32.powi(k);
            let (sin, cos) = (2.4 * k as f32).sin_cos();
            (f * (x * cos + z * sin) + 1.3 * k as f32).sin() / f
        };
        (0..9).map(|k| 0.28 * wave(k)).sum::<f32>()
    };
    let positions: Vec<P> = (0..=SIDE)
        .flat_map(|j| (0..=SIDE).map(move |i| (at(i), at(j))))
        .map(|(x, z)| [x, height(x, z), z])
        .collect();
    let indices: Vec<[u32; 3]> = (0..SIDE * SIDE)
        .flat_map(|cell| {
            let a = cell / SIDE * (SIDE + 1) + cell % SIDE;
            let b = a + SIDE + 1;
            [[a, b, a + 1], [a + 1, b, b + 1]]
        })
        .collect();
    k.mesh(&Mesh { positions: &positions, indices: &indices, ..Mesh::default() }, earth);
    k.build()
}

/// A landing strip at dusk, seen from just above the ground: strips of metal and varnish, and lamps as low as
/// the eye.
pub(super) fn grazing(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.0, 0.1, 6.0], [0.0, 0.02, 4.0], 28.0))?;
    let ground = k.diffuse([0.3, 0.3, 0.32])?;
    let black = k.diffuse([0.0; 3])?;
    k.sky(Environment {
        zenith: [0.01, 0.015, 0.03],
        horizon: [0.10, 0.07, 0.06],
        ground: [0.0; 3],
        sun: None,
    });
    k.floor(0.0, [-60.0, 60.0], [-60.0, 10.0], true, ground, None);
    for (i, roughness) in [0.02, 0.2, 0.7].into_iter().enumerate() {
        let metal = k.metal([0.9, 0.88, 0.84], roughness)?;
        let varnish = k.material(Material::Plastic {
            diffuse: [0.35, 0.08, 0.05].into(),
            specular: [1.0; 3],
            ior: 1.5,
            roughness,
            nonlinear: true,
        })?;
        for (j, material) in [metal, varnish].into_iter().enumerate() {
            let x = -0.78 + 0.26 * (2 * i + j) as f32;
            k.floor(1e-3, [x, x + 0.24], [-2.0, 5.6], true, material, None);
            // A lamp at the end of each strip, and a bollard that casts a long shadow
            k.ball([x + 0.12, 0.07, -2.5], 0.05, black, emission([40.0, 30.0, 20.0]));
            k.ball([x + 0.02, 0.02, 3.4 - 0.3 * i as f32], 0.02, ground, None);
        }
    }
    k.build()
}

/// Objects that reflect nothing, under a lamp out of view: the picture is 0.
pub(super) fn black(name: &str) -> Result<Scene, SceneError> {
    still_life(name, 0.0, true)
}

/// A still life without any light: the picture is 0.
pub(super) fn unlit(name: &str) -> Result<Scene, SceneError> {
    still_life(name, 0.7, false)
}

fn still_life(name: &str, albedo: f32, lamp: bool) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.0, 1.5, 4.0], [0.0, 0.5, 0.0], 38.0))?;
    let matt = k.diffuse([albedo; 3])?;
    let mirror = k.material(Material::Mirror { reflectance: [albedo; 3] })?;
    k.floor(0.0, [-3.0, 3.0], [-1.5, 6.0], true, matt, None);
    k.wall([-3.0, -1.5], [3.0, -1.5], [0.0, 4.0], matt);
    k.turned([-0.7, 0.0, 0.0], [0.6, 0.9, 0.6], 25.0, matt);
    k.ball([0.6, 0.45, 0.2], 0.45, mirror, None);
    if lamp {
        let radiance = 10.0 / (PI * 0.25);
        k.ball([0.0, 3.5, 5.0], 0.5, matt, emission([radiance; 3]));
    }
    k.build()
}
