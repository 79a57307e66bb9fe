//! Whether a scene has light of its own.

use super::daylight::daylight;
use noisefloor::{ProgressiveSource, Request, Tile, display::luminance};
use noisefloor_ptwne::{Camera, Environment, Ptwne, RenderOptions, Scene};
use std::sync::Arc;

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
