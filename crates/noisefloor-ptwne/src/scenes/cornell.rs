//! The Cornell box (Goral et al. 1984), 2 units wide.

use super::kit::{Kit, emission, look_at};
use crate::{Scene, SceneError};

pub(super) fn cornell_box(name: &str) -> Result<Scene, SceneError> {
    let mut k = Kit::new(name, look_at([0.0, 1.0, 3.82], [0.0, 1.0, 0.0], 39.0))?;
    let white = k.diffuse([0.73, 0.73, 0.71])?;
    let red = k.diffuse([0.61, 0.06, 0.05])?;
    let green = k.diffuse([0.13, 0.44, 0.10])?;
    let (x, z) = ([-1.0, 1.0], [-1.0, 1.0]);

    k.floor(0.0, x, z, true, white, None);
    k.floor(2.0, x, z, false, white, None);
    k.wall([-1.0, -1.0], [1.0, -1.0], [0.0, 2.0], white);
    k.wall([-1.0, 1.0], [-1.0, -1.0], [0.0, 2.0], red);
    k.wall([1.0, -1.0], [1.0, 1.0], [0.0, 2.0], green);
    k.turned([-0.34, 0.0, -0.32], [0.6, 1.2, 0.6], 18.0, white);
    k.turned([0.36, 0.0, 0.34], [0.6, 0.6, 0.6], -17.0, white);
    k.floor(1.995, [-0.24, 0.24], [-0.22, 0.18], false, white, emission([22.0, 18.0, 12.5]));
    k.build()
}
