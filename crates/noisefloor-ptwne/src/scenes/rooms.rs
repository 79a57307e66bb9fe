//! Rooms: a small light, a large light, and light from behind a door.

use super::kit::{Kit, emission, look_at};
use crate::{Material, Scene, SceneError};

/// A desk in a dim corner, under a bulb.
pub(super) fn bulb(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.15, 1.75, 4.1], [0.0, 0.78, 0.0], 36.0))?;
    let wall = k.diffuse([0.52, 0.56, 0.58])?;
    let boards = k.noise([[0.30, 0.17, 0.09], [0.55, 0.36, 0.20]], [1.2, 14.0])?;
    let wood = k.noise([[0.42, 0.26, 0.14], [0.66, 0.46, 0.28]], [9.0, 1.0])?;
    let clay = k.diffuse([0.62, 0.28, 0.16])?;
    let cream = k.diffuse([0.80, 0.76, 0.66])?;
    let blue = k.diffuse([0.12, 0.22, 0.46])?;
    let brass = k.metal([0.90, 0.68, 0.34], 0.18)?;
    let black = k.diffuse([0.03; 3])?;

    // Corner of a room
    k.floor(0.0, [-3.0, 3.0], [-1.8, 6.0], true, boards, None);
    k.floor(3.2, [-3.0, 3.0], [-1.8, 6.0], false, cream, None);
    k.wall([-3.0, -1.8], [3.0, -1.8], [0.0, 3.2], wall);
    k.wall([-3.0, 6.0], [-3.0, -1.8], [0.0, 3.2], wall);
    k.wall([3.0, -1.8], [3.0, 6.0], [0.0, 3.2], wall);
    k.wall([3.0, 6.0], [-3.0, 6.0], [0.0, 3.2], wall);

    // Desk and what is on it
    k.cuboid([-1.3, 0.52, -0.9], [1.3, 0.60, 0.8], wood);
    for (x, z) in [(-1.2, -0.8), (1.1, -0.8), (-1.2, 0.6), (1.1, 0.6)] {
        k.cuboid([x, 0.0, z], [x + 0.1, 0.52, z + 0.1], wood);
    }
    let vase = [[0.0, 0.0], [0.16, 0.0], [0.24, 0.16], [0.25, 0.3], [0.16, 0.5], [0.09, 0.6], [0.14, 0.72]];
    k.lathe([-0.75, 0.6, -0.25], &vase, 48, true, clay);
    let bowl = [
        [0.0, 0.0],
        [0.12, 0.0],
        [0.13, 0.03],
        [0.24, 0.12],
        [0.3, 0.24],
        [0.29, 0.24],
        [0.22, 0.12],
        [0.0, 0.04],
    ];
    k.lathe([0.7, 0.6, 0.2], &bowl, 48, true, brass);
    k.turned([0.62, 0.60, -0.45], [0.55, 0.10, 0.40], 14.0, blue);
    k.turned([0.60, 0.70, -0.45], [0.48, 0.08, 0.36], -8.0, cream);
    k.turned([0.64, 0.78, -0.44], [0.42, 0.09, 0.30], 22.0, clay);
    k.ball([-0.12, 0.78, 0.32], 0.18, cream, None);
    k.ball([-0.52, 0.70, 0.45], 0.10, blue, None);
    k.turned([-1.0, 0.6, 0.42], [0.22, 0.22, 0.22], 30.0, wood);

    // A bulb on a wire: a small sphere
    k.cuboid([0.045, 1.96, -0.205], [0.055, 3.2, -0.195], black);
    k.ball([0.05, 1.9, -0.2], 0.035, black, emission([1500.0, 1220.0, 840.0]));
    k.build()
}

/// A photographer's studio: metals of increasing roughness and a draped still life under a soft box.
pub(super) fn softbox(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.0, 1.5, 5.4], [0.0, 0.72, 0.0], 37.0))?;
    let paper = k.diffuse([0.55, 0.55, 0.57])?;
    let checker = k.checker([[0.65, 0.65, 0.62], [0.12, 0.13, 0.16]], [4.0, 4.0])?;
    let red = k.diffuse([0.60, 0.09, 0.07])?;
    let white = k.diffuse([0.8; 3])?;
    let copper = [0.95, 0.64, 0.54];
    let gold = [1.0, 0.78, 0.34];
    let metals = [(copper, 0.5), (gold, 0.25), ([0.92; 3], 0.08)];

    // A sweep of paper: floor, a rounded corner, wall
    k.floor(0.0, [-8.0, 8.0], [-1.6, 9.0], true, paper, None);
    let steps = 12;
    let at = |i: i32| {
        let (sin, cos) = (std::f32::consts::FRAC_PI_2 * i as f32 / steps as f32).sin_cos();
        [-1.6 - 1.2 * sin, 1.2 * (1.0 - cos)]
    };
    for i in 0..steps {
        let ([z0, y0], [z1, y1]) = (at(i), at(i + 1));
        k.quad([-8.0, y0, z0], [16.0, 0.0, 0.0], [0.0, y1 - y0, z1 - z0], paper, None);
    }
    k.wall([-8.0, -2.8], [8.0, -2.8], [1.2, 7.0], paper);

    k.cuboid([-1.75, 0.0, -0.75], [1.75, 0.18, 0.75], checker);
    for (i, (colour, roughness)) in metals.into_iter().enumerate() {
        let metal = k.metal(colour, roughness)?;
        k.ball([-1.15 + 1.15 * i as f32, 0.68, -0.12], 0.5, metal, None);
    }
    k.ball([-0.55, 0.34, 0.5], 0.16, red, None);
    k.turned([0.6, 0.18, 0.48], [0.24, 0.24, 0.24], 35.0, white);
    let cone = [[0.0, 0.0], [0.14, 0.0], [0.0, 0.36]];
    k.lathe([0.02, 0.18, 0.55], &cone, 40, false, red);

    // The soft box above, a strip from the left
    k.floor(3.6, [-2.2, 2.2], [-1.2, 2.2], false, white, emission([2.8, 2.8, 2.7]));
    k.quad([-4.2, 0.4, 2.6], [0.0, 2.2, 0.0], [0.6, 0.0, 0.8], white, emission([2.2, 2.6, 3.4]));
    k.build()
}

/// A room lit through a door that stands ajar.
pub(super) fn door(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([1.3, 1.45, 3.75], [-0.1, 0.95, -0.6], 48.0))?;
    let wall = k.diffuse([0.78, 0.75, 0.68])?;
    let hall = k.diffuse([0.85, 0.85, 0.84])?;
    let floor = k.checker([[0.62, 0.58, 0.50], [0.26, 0.20, 0.15]], [2.5, 2.5])?;
    let wood = k.diffuse([0.46, 0.28, 0.15])?;
    let (red, blue) = (k.diffuse([0.62, 0.13, 0.09])?, k.diffuse([0.14, 0.27, 0.52])?);
    let steel = k.metal([0.80, 0.82, 0.84], 0.15)?;
    let glass = k.material(Material::Glass { ior: 1.5, tint: [0.97; 3] })?;

    // The room: x −2.4…2.4, z −2…4, and the hall behind the wall at x = −2.4
    k.floor(0.0, [-5.0, 2.4], [-2.0, 4.0], true, floor, None);
    k.floor(2.6, [-5.0, 2.4], [-2.0, 4.0], false, wall, None);
    k.wall([-2.4, -2.0], [2.4, -2.0], [0.0, 2.6], wall);
    k.wall([2.4, -2.0], [2.4, 4.0], [0.0, 2.6], wall);
    k.wall([2.4, 4.0], [-5.0, 4.0], [0.0, 2.6], wall);
    k.wall([-5.0, -2.0], [-2.4, -2.0], [0.0, 2.6], hall);
    k.wall([-5.0, 4.0], [-5.0, -2.0], [0.0, 2.6], hall);
    // The wall with the door way, z −1.1…−0.1, 2.1 high
    k.cuboid([-2.5, 0.0, -2.0], [-2.4, 2.6, -1.1], wall);
    k.cuboid([-2.5, 0.0, -0.1], [-2.4, 2.6, 4.0], wall);
    k.cuboid([-2.5, 2.1, -1.1], [-2.4, 2.6, -0.1], wall);
    k.turned([-2.1, 0.02, -0.35], [0.98, 2.06, 0.05], 35.0, wood);
    k.floor(2.58, [-4.9, -2.9], [-1.9, 1.2], false, hall, emission([44.0, 40.0, 33.0]));

    // Table with a still life
    k.cuboid([-0.75, 0.68, -1.2], [1.15, 0.75, -0.1], wood);
    for (x, z) in [(-0.68, -1.13), (1.0, -1.13), (-0.68, -0.25), (1.0, -0.25)] {
        k.cuboid([x, 0.0, z], [x + 0.08, 0.68, z + 0.08], wood);
    }
    let pot = [
        [0.0, 0.0],
        [0.17, 0.0],
        [0.25, 0.1],
        [0.26, 0.2],
        [0.18, 0.32],
        [0.05, 0.36],
        [0.05, 0.4],
        [0.0, 0.42],
    ];
    k.lathe([-0.35, 0.75, -0.6], &pot, 48, true, steel);
    k.lathe([0.75, 0.75, -0.7], &pot, 48, true, red);
    k.ball([0.22, 0.93, -0.5], 0.18, glass, None);
    k.turned([-1.5, 0.0, -1.4], [0.55, 0.55, 0.55], 12.0, blue);
    k.turned([1.75, 0.0, -1.3], [0.6, 1.5, 0.6], 0.0, blue);
    k.turned([0.2, 1.3, -1.97], [1.3, 0.85, 0.04], 0.0, red);
    k.turned([0.2, 1.36, -1.96], [1.18, 0.73, 0.05], 0.0, hall);
    k.build()
}
