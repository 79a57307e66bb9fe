//! Scenes of one surface, and means with their standard errors.

use noisefloor::{ProgressiveSource, Request, Rgb, Tile};
use noisefloor_ptwne::{Camera, Environment, Material, Ptwne, RenderOptions, Scene, SceneBuilder};
use std::sync::Arc;

pub(crate) const UP: [f32; 3] = [0.0, 1.0, 0.0];

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
    mean_of(&means)
}

/// A mean, and its standard error.
pub(crate) fn mean_of(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Mean of a channel over the reference of `size`×`size` pixels.
pub(crate) fn reference(scene: Scene, size: usize, channel: usize) -> f64 {
    let pixels = source(scene, size).reference().unwrap().pixels;
    pixels.iter().map(|p| f64::from(p[channel])).sum::<f64>() / pixels.len() as f64
}

pub(crate) fn source(scene: impl Into<Arc<Scene>>, size: usize) -> Ptwne {
    Ptwne::new(scene, size, size, RenderOptions::default()).unwrap()
}

/// The share of a white sky that a plane shows at an angle from its normal, and its standard error.
pub(crate) fn albedo(material: &Material, degrees: f32, samples: u64) -> (f64, f64) {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let scene = scene(look([4.0 * sin, 4.0 * cos, 0.0], [0.0; 3], [0.0, 0.1, 1.0], 0.5), |b| {
        let m = b.material(material.clone()).unwrap();
        b.parallelogram([-9.0, 0.0, 9.0], [18.0, 0.0, 0.0], [0.0, 0.0, -18.0], m, None).unwrap();
        b.environment(Environment::constant([1.0; 3])).unwrap();
    });
    mean(scene, 4, 64, samples, 0, RenderOptions::default())
}

/// Asserts that a mean is `expected` within five standard errors and a relative `bias` that f32 may cause.
pub(crate) fn agrees((mean, error): (f64, f64), expected: f64, bias: f64) {
    let tolerance = 5.0 * error + bias * expected.abs();
    assert!((mean - expected).abs() <= tolerance, "{mean} ± {error}, expected {expected}");
    assert!(error < 0.02 * expected, "a standard error of {error} proves nothing about {expected}");
}
