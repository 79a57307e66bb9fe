//! Scenes of one surface, and means with their standard errors.

use noisefloor::{ProgressiveSource, Request, Rgb, Tile};
use noisefloor_ptwne::{Camera, Ptwne, RenderOptions, Scene, SceneBuilder};

pub(crate) fn look(eye: [f32; 3], target: [f32; 3], up: [f32; 3], vertical_fov: f32) -> Camera {
    Camera { eye, target, up, vertical_fov }
}

pub(crate) fn scene(camera: Camera, fill: impl FnOnce(&mut SceneBuilder)) -> Scene {
    let mut builder = SceneBuilder::new("test", camera).unwrap();
    fill(&mut builder);
    builder.build().unwrap()
}

/// One batch of the whole image.
pub(crate) fn batch(source: &mut Ptwne, first: u64, samples: u64) -> Vec<Rgb> {
    let (width, height) = (source.info().width, source.info().height);
    let tile = Tile { index: 0, x: 0, y: 0, width, height };
    let mut batches = source.sample(&[Request::new(tile, first, samples)]).unwrap();
    assert_eq!((batches.len(), batches[0].spp), (1, samples));
    batches.remove(0).mean
}

/// Mean of channel `channel` over the image, and its standard error from the spread of `batches` batches.
pub(crate) fn mean(
    scene: Scene,
    size: usize,
    batches: u64,
    samples: u64,
    channel: usize,
    options: RenderOptions,
) -> (f64, f64) {
    let mut source = Ptwne::new(scene, size, size, options).unwrap();
    let means: Vec<f64> = (0..batches)
        .map(|i| {
            let pixels = batch(&mut source, i * samples, samples);
            pixels.iter().map(|p| f64::from(p[channel])).sum::<f64>() / pixels.len() as f64
        })
        .collect();
    let n = batches as f64;
    let mean = means.iter().sum::<f64>() / n;
    let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Asserts that a mean is `expected` within five standard errors and a relative `bias` that f32 may cause.
pub(crate) fn agrees((mean, error): (f64, f64), expected: f64, bias: f64) {
    let tolerance = 5.0 * error + bias * expected.abs();
    assert!((mean - expected).abs() <= tolerance, "{mean} ± {error}, expected {expected}");
    assert!(error < 0.02 * expected, "a standard error of {error} proves nothing about {expected}");
}
