//! Nothing is said of samples that are right, and soon something of those that are wrong.

use crate::kit::Synthetic;
use noisefloor::watch::{Fault, MixUp, Warning};
use noisefloor::{ProgressiveSource, Request, Tile};
use noisefloor_image::{RenderLayers, StackSource, write_exr};
use noisefloor_ptwne::{Filter, Ptwne, RenderOptions, Sampling, scenes};
use noisefloor_testkit::check_silence;
use noisefloor_tests::mistakes::{Mistake, Outcome, Samples, feed};

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

/// The built-in Cornell box has its lamp in view. Whatever is said is said before a tile stops.
#[test]
fn mistakes_in_a_picture_with_a_lamp_are_noticed_before_a_tile_stops() {
    for (edge, seed) in [(64, 7), (64, 8), (64, 9), (128, 7)] {
        let options = RenderOptions { sampling: Sampling::Independent, seed, ..RenderOptions::default() };
        let scene = scenes::by_name("cornell-box").unwrap();
        let samples = Samples::of(Ptwne::new(scene, edge, edge, options).unwrap(), 160);
        for passes in [None, Some(16)] {
            let fed = |mistake| feed(&samples, 64, mistake, passes);
            let silent = |Outcome { warnings, fault, .. }: &Outcome| warnings.is_empty() && fault.is_none();
            let right = fed(Mistake::None);
            assert!(silent(&right), "{edge}, {passes:?}: {right:?}");

            let running = fed(Mistake::RunningMeans);
            // While they are doubted, no verdict is due, and so no look at them, until half as many more have come
            let sure = matches!(running.fault, Some((..=80, Fault::Running { .. })));
            assert!(sure, "{edge}, {seed}, {passes:?}: {running:?}");
            let again = fed(Mistake::OneSeed);
            let said = match passes {
                None => matches!(again.fault, Some((..=32, Fault::Repeated { .. }))),
                // Of one size, they may be those of a picture without noise
                Some(_) => matches!(again.warnings[..], [(..=48, Warning::Repeated { .. })]),
            };
            assert!(said, "{edge}, {passes:?}: {again:?}");
            let totals = fed(Mistake::RunningTotals);
            let sure = matches!(totals.fault, Some((..=80, Fault::Running { .. })));
            assert!(sure && totals.first_stop.is_none(), "{edge}, {seed}, {passes:?}: {totals:?}");
            assert_eq!((running.first_stop, again.first_stop), (None, None));

            for (mistake, correlation) in [(Mistake::GaussianFilter, 0.37), (Mistake::Blur, 0.67)] {
                let filtered = fed(mistake);
                let near = |c: f64| (c - correlation).abs() < 0.15;
                let said = matches!(filtered.warnings[..], [(..=32, Warning::Neighbours(c))] if near(c));
                assert!(
                    said && filtered.first_stop.is_none_or(|stop| stop > 32),
                    "{edge}, {passes:?}: {filtered:?}"
                );
            }
        }
        // In 64×64 pixels, tiles can stop before batches of several sizes have come
        if edge == 128 {
            let sizes_vary = feed(&samples, 64, Mistake::Srgb, None);
            assert!(matches!(sizes_vary.warnings[..], [(_, Warning::Encoded(_))]), "{edge}: {sizes_vary:?}");
        }
    }
}

/// Of four tiles of 64 pixels, and of 24 of 32.
#[test]
fn tiles_that_are_mixed_up_are_noticed() {
    for (width, height, tile) in [(128, 128, 64), (192, 128, 32)] {
        let scene = scenes::by_name("courtyard").unwrap();
        let options = RenderOptions { sampling: Sampling::Independent, ..RenderOptions::default() };
        let samples = Samples::of(Ptwne::new(scene, width, height, options).unwrap(), 64);
        let fed = |mistake| feed(&samples, tile, mistake, None).warnings;
        assert_eq!(fed(Mistake::None), []);
        let mixed_up = |mistake, how: MixUp| {
            let said = fed(mistake);
            assert!(
                matches!(said[..], [(_, Warning::MixedUp(found))] if found == how),
                "{mistake:?}: {said:?}"
            );
        };
        mixed_up(Mistake::Transposed, MixUp::Transposed);
        mixed_up(Mistake::Neighbour, MixUp::Shifted);
        if tile == 32 {
            // The sky's upper edge is too plain to show it in four tiles
            mixed_up(Mistake::RowsFlipped, MixUp::UpsideDown);
        }
    }
}
