//! The light of a scene that has none of its own.

use glam::Vec3;
use noisefloor_ptwne::{Camera, Environment, Sun};

/// Radiance at the horizon: grey, so that both white and black models stand out against it.
const HORIZON: f32 = 0.35;
/// Radiance of the sun: it and the dome make a white wall that faces it about 1.
const SUN: f32 = 24.0;
/// Half of the sun's apparent diameter in degrees: as wide as a window, so that its shadows are soft.
const SUN_RADIUS: f32 = 10.0;

/// A dome that is brighter above than below, and a wide sun over the viewer's left shoulder: surfaces
/// look different by how they face, and white ones do not vanish before a white background.
pub(super) fn daylight(camera: &Camera) -> Environment {
    let [eye, target, up] = [camera.eye, camera.target, camera.up].map(Vec3::from);
    let view = (target - eye).normalize_or(Vec3::NEG_Z);
    let right = view.cross(up).normalize_or(Vec3::X);
    let direction = (-view - 0.8 * right + 1.2 * right.cross(view)).to_array();
    let sun = Sun { direction, angular_radius: SUN_RADIUS, radiance: [SUN; 3] };
    Environment { zenith: [0.5; 3], horizon: [HORIZON; 3], ground: [0.12; 3], sun: Some(sun) }
}
