//! Nothing is said of samples that are right, and soon something of those that are wrong.

use crate::kit::Synthetic;
use noisefloor::watch::{Fault, MixUp, Warning};
use noisefloor::{Driver, FixedSpp, Oracle, Params, ProgressiveSource, Request, StoppingCriterion, Tile};
use noisefloor_image::{RenderLayers, StackSource, write_exr};
use noisefloor_ptwne::{
    Camera, Environment, Filter, Material, MaterialOptions, Optics, Ptwne, RenderOptions, Sampling, Scene,
    SceneBuilder, scenes,
};
use noisefloor_testkit::check_silence;
use noisefloor_tests::mistakes::{Mistake, Outcome, Samples, feed};
use std::sync::Arc;

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

/// What takes two values alone, in the same share everywhere: of points that share out that choice, a pixel has one of
/// two neighbouring counts, and its noise hangs on the number of samples in an irregular way.
fn two_values(ior: Option<f32>) -> Scene {
    let camera = Camera { eye: [0.0, 0.0, 5.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], vertical_fov: 20.0 };
    let mut builder = SceneBuilder::new("two values", camera).unwrap();
    builder.optics(Optics { parallel_height: Some(2.0), ..Optics::default() }).unwrap();
    let material = match ior {
        Some(ior) => builder.material(Material::Glass { ior, tint: [1.0; 3] }).unwrap(),
        None => {
            let [a, b] = [0.9, 0.3].map(|grey| builder.material(Material::diffuse([grey; 3])).unwrap());
            builder.mixed_material(a, b, [0.1; 3].into(), MaterialOptions::default()).unwrap()
        }
    };
    builder.parallelogram([-2.0, -2.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], material, None).unwrap();
    builder.environment(Environment::constant([1.0; 3])).unwrap();
    builder.build().unwrap()
}

/// 200 renders of small pictures by Sobol points, of all scenes and of surfaces of two values: with halves and without,
/// as the command renders for people and for `spp:64`. Where batches are independent, one look at one of the five
/// statistics errs with p < 7·10⁻¹⁰, and there are less than 10⁴; nothing else may be said at all.
#[test]
fn own_samples_are_never_accused() {
    let rendered = scenes::list().chain(scenes::stiff()).map(|scene| scene.name);
    let mut jobs: Vec<(Arc<Scene>, u64)> =
        rendered.map(|name| (scenes::by_name(name).unwrap().into(), 4)).collect();
    jobs.extend([1.33, 1.45, 1.5, 1.6034, 1.8, 2.4, 3.5].map(|ior| (two_values(Some(ior)).into(), 16)));
    jobs.push((two_values(None).into(), 16));
    let mut runs = 0;
    for (scene, seeds) in jobs {
        for seed in 1..=seeds {
            let options = RenderOptions { seed, ..RenderOptions::default() };
            let source = Ptwne::new(Arc::clone(&scene), 32, 32, options).unwrap();
            let (criterion, spp): (Box<dyn StoppingCriterion>, _) =
                if seed % 2 == 0 { (Box::new(FixedSpp(64)), 64) } else { (Box::new(Oracle::bundled()), 96) };
            let mut driver = Driver::new(source, criterion, Params::default().with_max_spp(spp)).unwrap();
            let name = driver.source().info().name;
            driver.run(|_, _| ()).unwrap_or_else(|error| panic!("{name}, seed {seed}: {error}"));
            let said = driver.session().warnings().iter().filter(|w| !matches!(w, Warning::Constant(_)));
            assert_eq!(said.count(), 0, "{name}, seed {seed}: {:?}", driver.session().warnings());
            runs += 1;
        }
    }
    assert!(runs >= 200, "{runs}");
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
    check_silence(StackSource::open(batches.path()).unwrap(), 400);
    check_silence(StackSource::open(means.path()).unwrap(), 400);
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
