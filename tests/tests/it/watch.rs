//! Nothing is said of samples that are right.

use crate::kit::Synthetic;
use noisefloor::{ProgressiveSource, Request, Tile};
use noisefloor_image::{RenderLayers, StackSource, write_exr};
use noisefloor_ptwne::{Filter, Ptwne, RenderOptions, Sampling, scenes};
use noisefloor_testkit::check_silence;

/// Every scene that the renderer has, with its samplers and filters in turn.
#[test]
fn the_path_tracer_is_silent() {
    let filters = [Filter::Box, Filter::Tent, Filter::Gaussian];
    for (number, scene) in scenes::list().chain(scenes::stiff()).enumerate() {
        let sampling = if number % 2 == 0 { Sampling::Independent } else { Sampling::Sobol };
        let filter = filters[number % 3];
        let options = RenderOptions { seed: number as u64, sampling, filter, ..RenderOptions::default() };
        let scene = scenes::by_name(scene.name).unwrap();
        check_silence(Ptwne::new(scene, 64, 48, options).unwrap(), 160);
    }
}

/// Batches as stored, and as running means of which differences are taken.
#[test]
fn stacks_on_disk_are_silent() {
    let (width, height) = (64, 48);
    let (batches, means) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (mut source, mut sum) = (Synthetic::new(width, height), vec![[0.0f64; 3]; width * height]);
    let tile = Tile { index: 0, x: 0, y: 0, width, height };
    for first in (0..400).step_by(20) {
        let last = first + 20;
        let mean = source.sample(&[Request::new(tile, first, 20)]).unwrap().remove(0).mean;
        let pixels = sum.iter_mut().zip(&mean);
        pixels.for_each(|(sum, new)| sum.iter_mut().zip(new).for_each(|(s, n)| *s += 20.0 * f64::from(*n)));
        let running: Vec<_> = sum.iter().map(|p| p.map(|c| (c / last as f64) as f32)).collect();
        let name = format!("batch_{first:05}_{last:05}.exr");
        write_exr(batches.path().join(name), &RenderLayers::rgb(width, height, &mean)).unwrap();
        let name = format!("{last:05}.exr");
        write_exr(means.path().join(name), &RenderLayers::rgb(width, height, &running)).unwrap();
    }
    check_silence(StackSource::open_batches(batches.path()).unwrap(), 400);
    check_silence(StackSource::open_running_means(means.path()).unwrap(), 400);
}
