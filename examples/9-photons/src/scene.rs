//! Two lamps among walls that reflect, let through and scatter.

use rustic_zen::material::hqz_legacy;
use rustic_zen::prelude::{Light, Sampler, Scene, Segment};

/// The scene, for a picture of this size.
pub(crate) fn lamps(width: usize, height: usize) -> Scene {
    let (w, h) = (width as f64, height as f64);
    let at = |x: f64, y: f64| (x * w, y * h);
    let lamp = |x, y, radius: f64, kelvin: f64| {
        let around = Sampler::new_range(0.0, 360.0);
        let disk = Sampler::new_range(0.0, radius * h);
        Light::new(at(x, y), 1.0, disk, around.clone(), around, Sampler::new_blackbody(kelvin))
    };
    let wall = |from, to, scatters, reflects, lets_through| {
        Segment::line_from_points(from, to, hqz_legacy(scatters, reflects, lets_through))
    };
    Scene::new(width, height)
        .with_light(lamp(0.3, 0.3, 0.05, 2600.0))
        .with_light(lamp(0.8, 0.75, 0.02, 7000.0))
        .with_object(wall(at(0.05, 0.9), at(0.6, 0.8), 0.6, 0.2, 0.0))
        .with_object(wall(at(0.5, 0.15), at(0.65, 0.5), 0.1, 0.3, 0.5))
        .with_object(wall(at(0.9, 0.1), at(0.95, 0.6), 0.0, 0.9, 0.0))
        .with_object(wall(at(0.15, 0.45), at(0.4, 0.6), 0.8, 0.0, 0.1))
}
