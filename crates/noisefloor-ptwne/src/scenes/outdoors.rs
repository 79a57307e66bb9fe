//! Under the sky.

use super::kit::{Kit, look_at};
use crate::{Environment, Scene, SceneError, Sun};

/// A court with steps, an arcade and a well, in sun and sky.
pub(super) fn courtyard(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([5.2, 2.5, 8.4], [-0.5, 1.55, 0.0], 42.0))?;
    let paving = k.checker([[0.36, 0.33, 0.29], [0.28, 0.26, 0.24]], [1.0, 1.0])?;
    let brick = k.brick([[0.52, 0.23, 0.15], [0.55, 0.52, 0.47]], [2.2, 5.0])?;
    let plaster = k.noise([[0.62, 0.55, 0.44], [0.76, 0.70, 0.60]], [1.5, 1.5])?;
    let stone = k.diffuse([0.56, 0.54, 0.50])?;
    let roof = k.diffuse([0.40, 0.15, 0.09])?;
    let leaf = k.diffuse([0.10, 0.24, 0.06])?;
    let clay = k.diffuse([0.58, 0.26, 0.14])?;
    let bronze = k.metal([0.72, 0.52, 0.30], 0.3)?;

    let dome = Environment {
        zenith: [0.16, 0.27, 0.56],
        horizon: [0.52, 0.60, 0.72],
        ground: [0.16, 0.15, 0.13],
        sun: Some(Sun {
            direction: [0.75, 0.62, 0.12],
            angular_radius: 0.6,
            radiance: [13000.0, 11400.0, 9000.0],
        }),
    };
    k.sky(dome);
    k.floor(0.0, [-30.0, 30.0], [-30.0, 30.0], true, paving, None);

    // Wall at the left, of brick; arcade at the back
    k.cuboid([-6.4, 0.0, -5.0], [-6.0, 3.2, 6.0], brick);
    k.cuboid([-6.5, 3.2, -5.0], [-5.9, 3.35, 6.0], stone);
    k.cuboid([-6.0, 0.0, -6.4], [6.0, 4.4, -6.0], plaster);
    k.cuboid([-6.0, 0.0, -6.0], [6.0, 0.3, -3.6], stone);
    k.cuboid([-6.0, 0.0, -3.6], [6.0, 0.15, -3.1], stone);
    k.cuboid([-6.2, 3.0, -4.3], [6.2, 3.5, -3.8], plaster);
    let slope = [0.0, 1.0, -2.8];
    k.quad([-6.4, 3.5, -3.6], [12.8, 0.0, 0.0], slope, roof, None);
    let column =
        [[0.26, 0.0], [0.26, 0.14], [0.19, 0.2], [0.16, 2.35], [0.2, 2.42], [0.28, 2.5], [0.28, 2.7]];
    for i in 0..7 {
        k.lathe([-5.4 + 1.8 * i as f32, 0.3, -4.05], &column, 32, false, stone);
    }
    for x in [-3.6, 0.0, 3.6] {
        k.cuboid([x - 0.5, 0.3, -6.0], [x + 0.5, 2.4, -5.97], roof);
    }

    // A well with a bronze ball, pots with clipped trees
    let basin = [[1.15, 0.0], [1.15, 0.5], [0.95, 0.5], [0.95, 0.12], [0.0, 0.12]];
    k.lathe([-1.2, 0.0, 0.2], &basin, 12, false, stone);
    let stem = [[0.22, 0.1], [0.2, 0.2], [0.13, 0.3], [0.11, 0.85], [0.3, 1.0], [0.3, 1.05], [0.0, 1.05]];
    k.lathe([-1.2, 0.0, 0.2], &stem, 32, false, stone);
    k.ball([-1.2, 1.42, 0.2], 0.38, bronze, None);
    let pot = [[0.0, 0.0], [0.28, 0.0], [0.38, 0.55], [0.42, 0.55], [0.42, 0.65], [0.34, 0.65], [0.0, 0.6]];
    for (x, z) in [(-4.6, 2.2), (-4.6, -1.0), (2.6, -2.2), (2.2, 2.4)] {
        k.lathe([x, 0.0, z], &pot, 32, false, clay);
        k.cuboid([x - 0.04, 0.6, z - 0.04], [x + 0.04, 1.1, z + 0.04], clay);
        for i in 0..90 {
            // Foliage: balls on a spiral around the crown
            let t = (i as f32 + 0.5) / 90.0;
            let (sin, cos) = (i as f32 * 2.399_963).sin_cos();
            let (y, r) = (1.0 - 2.0 * t, (1.0 - (1.0 - 2.0 * t) * (1.0 - 2.0 * t)).sqrt());
            k.ball([x + 0.4 * r * cos, 1.45 + 0.4 * y, z + 0.4 * r * sin], 0.1, leaf, None);
        }
    }
    k.turned([0.9, 0.0, -1.3], [1.4, 0.42, 0.45], 24.0, stone);
    k.build()
}
