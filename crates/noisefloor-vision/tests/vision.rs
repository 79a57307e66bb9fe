//! What can be said of the model without recordings: known answers, directions, symmetries, bad input.
#![allow(missing_docs, reason = "tests")]

use noisefloor_vision::{Viewing, VisionError, VisionModel, VisionWorkspace};
use proptest::prelude::*;

/// A picture with edges and colours.
fn picture(width: usize, height: usize) -> Vec<[f32; 3]> {
    let pixel = |i: usize| {
        let (x, y) = (i % width, i / width);
        let wall = 0.4 + 0.2 * ((x * y) as f32 / 300.0).sin();
        [wall, 0.9 * wall, if (x / 11 + y / 7) % 2 == 0 { 0.3 } else { 0.6 }]
    };
    (0..width * height).map(pixel).collect()
}

/// The picture with noise of this range to either side, grey if `colour` is 0.
fn noisy(picture: &[[f32; 3]], amount: f32, colour: u32, seed: u32) -> Vec<[f32; 3]> {
    let noise = |i: usize, channel: u32| {
        let mut h =
            (i as u32).wrapping_mul(0x9E37_79B1) ^ (channel * colour + seed).wrapping_mul(0x85EB_CA77);
        h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
        h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
        amount * (2.0 * ((h ^ (h >> 15)) as f32 / u32::MAX as f32) - 1.0)
    };
    let pixels = picture.iter().enumerate();
    pixels.map(|(i, pixel)| std::array::from_fn(|c| pixel[c] + noise(i, c as u32))).collect()
}

fn jod(viewing: &str, test: &[[f32; 3]], reference: &[[f32; 3]], size: (usize, usize)) -> f64 {
    let model = VisionModel::new(&viewing.parse::<Viewing>().expect("conditions"));
    model.compare(test, reference, size, &mut VisionWorkspace::default()).expect("two pictures").jod()
}

#[test]
fn nobody_sees_a_difference_between_a_picture_and_itself() {
    for size in [(2, 2), (5, 3), (128, 96)] {
        let picture = picture(size.0, size.1);
        let model = VisionModel::new(&Viewing::default());
        let mut workspace = VisionWorkspace::default();
        let mut found = model.compare(&picture, &picture, size, &mut workspace).unwrap();
        assert_eq!(found.jod(), 10.0);
        assert!(found.map().iter().all(|&lost| lost == 0.0));
    }
}

#[test]
fn from_further_away_noise_is_less_visible_and_on_a_brighter_display_more() {
    let size = (128, 128);
    let reference = picture(size.0, size.1);
    for colour in [0, 1] {
        let test = noisy(&reference, 0.04, colour, 1);
        let of = |viewing: &str| jod(viewing, &test, &reference, size);
        assert!(of("desk,distance=1.2") > of("desk") + 0.1);
        assert!(of("desk,distance=0.3") < of("desk") - 0.1);
        assert!(of("desk,peak=800") < of("desk") - 0.02);
        assert!(of("desk,peak=20") > of("desk") + 0.05);
        // Light of the room that the display reflects lowers contrast in the dark
        let dark: Vec<_> = reference.iter().map(|pixel| pixel.map(|v| 0.2 * v)).collect();
        let in_light = |viewing: &str| jod(viewing, &noisy(&dark, 0.04, colour, 1), &dark, size);
        assert!(in_light("desk,ambient=5000") > in_light("desk,ambient=0") + 0.1);
    }
}

#[test]
fn grey_noise_is_more_visible_than_noise_in_colour_alone() {
    let size = (128, 128);
    let reference = vec![[0.5; 3]; 128 * 128];
    let grey = noisy(&reference, 0.03, 0, 1);
    // The same noise in red, and its opposite in green, in the ratio of their luminances
    let colour = grey.iter().map(|p| [p[0], 0.5 - (p[0] - 0.5) * 0.2126 / 0.7152, 0.5]).collect::<Vec<_>>();
    assert!(jod("desk", &grey, &reference, size) < jod("desk", &colour, &reference, size) - 0.1);
}

#[test]
fn texture_hides_noise() {
    let size = (128, 128);
    let flat = vec![[0.5; 3]; 128 * 128];
    let textured = noisy(&flat, 0.2, 0, 9);
    let lost = |reference: &[[f32; 3]]| 10.0 - jod("desk", &noisy(reference, 0.03, 0, 1), reference, size);
    assert!(lost(&textured) < 0.7 * lost(&flat), "{} and {}", lost(&textured), lost(&flat));
}

#[test]
fn bad_sizes_are_refused() {
    let model = VisionModel::new(&Viewing::default());
    let mut workspace = VisionWorkspace::default();
    let pixels = vec![[0.5; 3]; 64];
    for (width, height) in [(0, 0), (1, 1), (1, 64), (64, 1), (0, 64), (usize::MAX, 2), (1 << 15, 1 << 14)] {
        let refused = model.compare(&pixels, &pixels, (width, height), &mut workspace).unwrap_err();
        assert_eq!(refused, VisionError::Size { width, height });
    }
    let refused = model.compare(&pixels, &pixels[1..], (8, 8), &mut workspace).unwrap_err();
    assert_eq!(refused, VisionError::Length { width: 8, height: 8, found: 63 });
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut broken = pixels.clone();
        broken[17][1] = bad;
        let refused = model.compare(&pixels, &broken, (8, 8), &mut workspace).unwrap_err();
        assert_eq!(refused, VisionError::NotFinite { index: 17 });
    }
}

#[test]
fn a_workspace_does_not_remember() {
    let model = VisionModel::new(&Viewing::default());
    let mut used = VisionWorkspace::default();
    let large = picture(200, 150);
    model.compare(&noisy(&large, 0.3, 1, 2), &large, (200, 150), &mut used).unwrap().map();
    for size in [(31, 33), (128, 64)] {
        let reference = picture(size.0, size.1);
        let test = noisy(&reference, 0.05, 1, 3);
        let again = model.compare(&test, &reference, size, &mut used).unwrap().map().to_vec();
        let mut fresh = VisionWorkspace::default();
        assert_eq!(again, model.compare(&test, &reference, size, &mut fresh).unwrap().map());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn whatever_the_values_the_result_is_finite(
        width in 2usize..24, height in 2usize..24, seed in any::<u32>(), scale in -38i32..38,
        viewing in prop_oneof![
            Just("desk"), Just("standard_hdr_pq"), Just("standard_hdr_hlg"), Just("standard_hdr_linear"),
            Just("ppd=1,peak=1,black=0,ambient=0"),
            Just("ppd=2000,peak=20000,black=0,ambient=100000,eotf=gamma4"),
        ],
    ) {
        let size = (width, height);
        let grey = vec![[0.0; 3]; width * height];
        let large = noisy(&grey, 10f32.powi(scale), 1, seed);
        let small = noisy(&grey, 10f32.powi(-scale), 1, seed ^ 1);
        let model = VisionModel::new(&viewing.parse::<Viewing>().unwrap());
        let mut workspace = VisionWorkspace::default();
        let mut found = model.compare(&large, &small, size, &mut workspace).unwrap();
        prop_assert!(found.jod().is_finite() && found.jod() <= 10.0);
        prop_assert!(found.map().iter().all(|lost| lost.is_finite() && *lost >= 0.0));
    }

    #[test]
    fn more_noise_is_never_better(
        amount in 0.002f32..0.2, more in 1.2f32..4.0, colour in 0u32..2, seed in any::<u32>(),
    ) {
        let size = (48, 48);
        let reference = picture(size.0, size.1);
        let of = |amount| jod("desk", &noisy(&reference, amount, colour, seed), &reference, size);
        // Noise is cut off at black and white, and may mask itself a little
        prop_assert!(of(amount * more) <= of(amount) + 0.01);
    }

    #[test]
    fn pictures_may_be_turned_over(seed in any::<u32>(), amount in 0.01f32..0.1) {
        // Levels of 65, 33, 17, 9 … pixels have the same borders on all sides
        let edge = 65;
        let reference = picture(edge, edge);
        let test = noisy(&reference, amount, 1, seed);
        let turn = |pixels: &[[f32; 3]], from: fn(usize, usize) -> usize| -> Vec<[f32; 3]> {
            (0..edge * edge).map(|i| pixels[from(i % edge, i / edge)]).collect()
        };
        let upright = jod("desk", &test, &reference, (edge, edge));
        for from in [|x: usize, y: usize| x * 65 + y, |x, y| y * 65 + 64 - x, |x, y| (64 - y) * 65 + x] {
            let turned = jod("desk", &turn(&test, from), &turn(&reference, from), (edge, edge));
            prop_assert!((turned - upright).abs() < 2e-4, "{turned} and {upright}");
        }
    }
}
