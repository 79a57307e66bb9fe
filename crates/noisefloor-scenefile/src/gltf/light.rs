//! The light of a scene: `KHR_lights_punctual`, whether it is enough to see by, and a sky where it is not.

use super::asset::Asset;
use super::nodes::Placed;
use super::parts::name;
use crate::{LoadError, Place};
use glam::Vec3;
use gltf::json::Index;
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type};
use gltf::json::validation::Checked;
use noisefloor::display::luminance;
use noisefloor::{ProgressiveSource, Request, Tile};
use noisefloor_ptwne::{
    Camera, Environment, Falloff, Ptwne, Punctual, RenderOptions, Scene, SceneBuilder, Sun,
};
use std::sync::Arc;

/// Adds the light of a node. Candela become units of radiant intensity, and lux of irradiance, by their
/// numbers, as nits of emissive materials become units of radiance.
pub(super) fn add(
    asset: &Asset<'_>,
    placed: &Placed<'_>,
    index: Index<Light>,
    builder: &mut SceneBuilder,
) -> Result<(), LoadError> {
    let light = asset.get(index, "light", &placed.place)?;
    let place = Place::part(asset.path, name("light", index.value(), light.name.as_deref()));
    if light.range.is_some() {
        asset.load.ignored(&place, "its range is ignored: light reaches any distance");
    }
    let power = light.color.map(|x| x * light.intensity);
    let position = placed.to_world.translation.as_vec3().to_array();
    let direction = (-placed.to_world.matrix3.z_axis).normalize_or_zero().as_vec3().to_array();
    let punctual = match (&light.type_, &light.spot) {
        (Checked::Valid(Type::Point), _) => Punctual::Point { position, intensity: power },
        (Checked::Valid(Type::Directional), _) => Punctual::Distant { direction, irradiance: power },
        (Checked::Valid(Type::Spot), Some(spot)) => {
            let [inner, outer] = [spot.inner_cone_angle, spot.outer_cone_angle].map(f32::to_degrees);
            // Exporters write equal angles for a hard edge
            let inner = inner.min(0.999 * outer);
            let falloff = Falloff::Squared;
            Punctual::Spot { position, direction, intensity: power, inner, outer, falloff }
        }
        _ => return Err(place.bad("it is not a point, directional or spot light with its properties")),
    };
    builder.punctual(punctual).map_err(place.refused())
}

// Whether a scene has light of its own.

/// Edge of the pictures that are compared, in pixels, and their samples a pixel.
const EDGE: usize = 32;
const SAMPLES: u64 = 16;
/// Segments of their paths: direct light, and what it reaches next.
const DEPTH: u32 = 3;
/// A pixel is shown if its own light is this share of what it would reflect of daylight,
const ENOUGH: f32 = 0.02;
/// and a scene if so many are of all that daylight shows: headlights alone are a scene in the dark.
const SHARE: f32 = 0.25;

/// The sky of a scene that has too little light of its own to be seen by; none if it has enough. Found by
/// rendering it small, with its own light and with daylight: only that tells what arrives.
pub(super) fn missing_daylight(scene: &Scene, camera: &Camera) -> Option<Environment> {
    let sky = daylight(camera);
    let own = picture(&Arc::new(scene.clone()), DEPTH)?;
    let daylit = Arc::new(scene.clone().with_environment(sky).ok()?);
    // Without what is seen directly. The same samples meet the same surfaces first, so that the difference
    // is exact
    let (all, direct) = (picture(&daylit, DEPTH)?, picture(&daylit, 1)?);
    let (mut visible, mut shown) = (0u32, 0u32);
    for ((own, all), direct) in own.iter().zip(all).zip(direct) {
        let reflected = all - direct;
        if reflected > 0.0 {
            visible += 1;
            shown += u32::from(*own >= ENOUGH * reflected);
        }
    }
    ((shown as f32) < SHARE * visible as f32).then_some(sky)
}

/// The luminance of each pixel, of paths of this many segments.
fn picture(scene: &Arc<Scene>, max_depth: u32) -> Option<Vec<f32>> {
    let options = RenderOptions { max_depth, ..RenderOptions::default() };
    let mut source = Ptwne::new(scene.clone(), EDGE, EDGE, options).ok()?;
    let tile = Tile { index: 0, x: 0, y: 0, width: EDGE, height: EDGE };
    let batches = source.sample(&[Request::new(tile, 0, SAMPLES)]).ok()?;
    Some(batches.first()?.mean.iter().map(|pixel| luminance(*pixel)).collect())
}

// The light of a scene that has none of its own.

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
