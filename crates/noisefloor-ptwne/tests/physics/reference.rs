//! The reference keeps its promises about its own noise.

use crate::kit::{batch, look, scene};
use noisefloor::{ToneMapping, descriptor::NoiseMask, evidence::Plane};
use noisefloor_ptwne::{Emission, Material, Ptwne, RenderOptions, Scene, scenes};
use std::error::Error;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};

/// A tenth of the noise mask energy that the most demanding observers see, 1.0/255, as a standard deviation.
const PROMISE: f64 = 0.32 / 255.0;

/// The standard deviation of a reference's noise mask, measured from two seeds at the exposure of the
/// path-traced picture; the reference's own estimate of it; and the number of blocks with more noise than
/// promised.
fn deviation(scene: Scene, size: usize) -> (f64, f64, usize) {
    let scene = Arc::new(scene);
    let source = |seed| {
        Ptwne::new(scene.clone(), size, size, RenderOptions { seed, ..RenderOptions::default() }).unwrap()
    };
    let display = ToneMapping::default().settle(&batch(&mut source(3), 0, 16));
    let (mut own, mut unsettled) = (0.0, 0);
    let shown = [1, 2].map(|seed| {
        let mut source = source(seed);
        let pixels = source.reference().unwrap().pixels;
        let noise = source.reference_noise().unwrap();
        own += 0.5 * f64::from(noise.deviation());
        unsettled += noise.unsettled;
        pixels.iter().map(|p| display.luma(*p)).collect::<Vec<f32>>()
    });
    let error = |(y, x): (usize, usize)| {
        (shown[0][y * size + x] - shown[1][y * size + x]) * std::f32::consts::FRAC_1_SQRT_2
    };
    let mask = NoiseMask::default().apply(&Plane::from_fn((size, size), error));
    let energy = mask.values().iter().map(|m| f64::from(*m).powi(2)).sum::<f64>() / (size * size) as f64;
    (energy.sqrt(), own, unsettled)
}

/// Edges, penumbrae, hard shadows, textures, sun and sky. Each block stops when its own estimate is 0.36/255,
/// of which the mask passes 0.85: 0.305. The estimate is accurate to 1/√(2·256) = 4 % in one block, and more
/// so in the mean of 16.
#[test]
fn its_noise_is_a_tenth_of_what_is_seen() {
    for name in ["cornell-box", "bulb", "courtyard"] {
        let (deviation, _, unsettled) = deviation(scenes::by_name(name).unwrap(), 64);
        assert!(deviation < PROMISE, "{name}: {}/255", deviation * 255.0);
        assert_eq!(unsettled, 0, "{name}");
    }
}

/// A lamp that nearly touches the wall it lights: light samples by themselves would have infinite variance.
#[test]
fn lamps_close_to_walls_leave_no_noise() {
    let scene = scene(look([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 30.0), |b| {
        let wall = b.material(Material::diffuse([0.5; 3])).unwrap();
        b.parallelogram([-9.0, -9.0, 0.0], [18.0, 0.0, 0.0], [0.0, 18.0, 0.0], wall, None).unwrap();
        let lamp = Some(Emission::two_sided([1.0; 3]));
        b.parallelogram([-1.0, 0.0, 0.002], [2.0, 0.0, 0.0], [0.0, 0.0, 0.5], wall, lamp).unwrap();
    });
    let (deviation, _, unsettled) = deviation(scene, 32);
    assert!(deviation < PROMISE, "{}/255", deviation * 255.0);
    assert_eq!(unsettled, 0);
}

/// The watcher is called once per block, and can cancel the reference.
#[test]
fn it_is_watched_and_given_up() {
    let mut source =
        Ptwne::new(scenes::by_name("cornell-box").unwrap(), 40, 24, RenderOptions::default()).unwrap();
    let told = Arc::new(Mutex::new(Vec::new()));
    let list = Arc::clone(&told);
    source.watch_reference(move |done, all| {
        list.lock().unwrap().push((done, all));
        ControlFlow::Continue(())
    });
    source.reference().unwrap();
    let mut told = std::mem::take(&mut *told.lock().unwrap());
    told.sort_unstable();
    assert_eq!(told, [(1, 6), (2, 6), (3, 6), (4, 6), (5, 6), (6, 6)]);

    source
        .watch_reference(|done, _| if done < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) });
    let error = source.reference().unwrap_err();
    assert!(error.source().unwrap().to_string().contains("cancelled"), "{error:?}");
    // The next reference is complete
    source.watch_reference(|_, _| ControlFlow::Continue(()));
    source.reference().unwrap();
}

/// Dim lamps beside bright ones, which light samples by power do not find: the reference stops at its cap and
/// reports the noise that is left. A few pixels have most of the error, so that its estimate is accurate to a
/// factor of two; seeds are fixed.
#[test]
fn what_is_left_at_the_cap_is_told() {
    // The niche of 1, and a row of pixels of that of 10⁶
    let camera = look([0.0, -0.085, 7.0], [0.0, -0.085, 0.0], [0.0, 1.0, 0.0], 9.55);
    let niches = scenes::by_name("decades").unwrap().with_camera(camera).unwrap();
    let (deviation, own, unsettled) = deviation(niches, 16);
    assert!(deviation > 2.0 * PROMISE, "{}/255", deviation * 255.0);
    assert_eq!(unsettled, 2);
    assert!(
        (0.5 * deviation..2.0 * deviation).contains(&own),
        "{} of {}/255",
        own * 255.0,
        deviation * 255.0
    );
}
