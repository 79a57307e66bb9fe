use super::*;
use noisefloor::{Rgb, display::srgb_encode};
use noisefloor_testkit::Noise;

const EDGE: usize = 144;

/// Contrast, frequency in cycles per pixel, and angle in radians of a grating whose crest is in the middle of
/// the picture.
type Grating = (f64, f64, f64);

/// Gratings on a screen of the adaptation luminance.
fn screen(gratings: &[Grating]) -> Vec<Rgb> {
    let viewing = VdpViewing::default();
    let middle = (EDGE / 2) as f64;
    let value = |i: usize| {
        let (x, y) = ((i % EDGE) as f64 - middle, (i / EDGE) as f64 - middle);
        let wave = |&(contrast, frequency, angle): &Grating| {
            contrast * (std::f64::consts::TAU * frequency * (x * angle.cos() + y * angle.sin())).cos()
        };
        let luminance = viewing.adaptation * (1.0 + gratings.iter().map(wave).sum::<f64>());
        [srgb_encode((luminance / viewing.peak) as f32); 3]
    };
    (0..EDGE * EDGE).map(value).collect()
}

/// Largest probability around the middle.
fn seen(vdp: &Vdp, a: &[Grating], b: &[Grating]) -> f32 {
    let (a, b) = (screen(a), screen(b));
    let [a, b] = [&a, &b].map(|pixels| DisplayPixels::new(EDGE, EDGE, pixels).unwrap());
    let map = vdp.visible(&a, &b).unwrap();
    let rows = EDGE / 2 - 12..EDGE / 2 + 12;
    rows.flat_map(|y| &map.values[y * EDGE + EDGE / 2 - 12..][..24]).copied().fold(0.0, f32::max)
}

/// The contrast of a grating, on top of a mask, that is seen with a probability of ½.
fn threshold(vdp: &Vdp, frequency: f64, angle: f64, mask: &[Grating]) -> f64 {
    let (mut low, mut high) = (1e-4f64, 1.0f64);
    while high / low > 1.005 {
        let middle = (low * high).sqrt();
        let with = [mask, &[(middle, frequency, angle)]].concat();
        if seen(vdp, mask, &with) < 0.5 { low = middle } else { high = middle }
    }
    low
}

/// What the sensitivity function says.
fn published(frequency: f64, angle: f64) -> f64 {
    let viewing = VdpViewing::default();
    let per_degree = viewing.pixels_per_degree();
    1.0 / viewing.sensitivity(frequency * per_degree, angle, (EDGE as f64 / per_degree).powi(2))
}

#[test]
fn gratings_are_detected_at_the_threshold_of_the_sensitivity_function() {
    // In the middle of a band, 1.6…13 cycles per degree, along both axes and in between.
    let vdp = Vdp::default();
    let third = std::f64::consts::FRAC_PI_3;
    for (frequency, angle) in [
        (1.0 / 24.0, 0.0),
        (1.0 / 12.0, 0.0),
        (1.0 / 6.0, 0.0),
        (1.0 / 3.0, 0.0),
        (1.0 / 6.0, 1.5 * third),
        (1.0 / 6.0, third),
    ] {
        let ratio = threshold(&vdp, frequency, angle, &[]) / published(frequency, angle);
        assert!((0.95..1.05).contains(&ratio), "{frequency} {angle}: {ratio}");
    }
}

#[test]
fn detection_rises_by_the_psychometric_function() {
    let vdp = Vdp::default();
    let frequency = 1.0 / 6.0;
    let half = threshold(&vdp, frequency, 0.0, &[]);
    for times in [0.6f64, 0.8, 1.25, 1.6] {
        let seen = f64::from(seen(&vdp, &[], &[(times * half, frequency, 0.0)]));
        let expected = 1.0 - (-times.powf(3.5)).exp2();
        assert!((seen - expected).abs() < 0.03, "{times}: {seen}, not {expected}");
    }
}

#[test]
fn between_bands_two_of_them_see_half() {
    // Each has ½: 2·(½·c)^β = 1 at c = 2·2^(−1/β) = 1.641.
    let vdp = Vdp::default();
    for (frequency, angle) in [(1.0 / 8.0, 0.0), (1.0 / 6.0, 0.5 * std::f64::consts::FRAC_PI_6)] {
        let ratio = threshold(&vdp, frequency, angle, &[]) / published(frequency, angle);
        assert!((ratio / 1.641 - 1.0).abs() < 0.05, "{frequency} {angle}: {ratio}");
    }
}

#[test]
fn a_mask_of_the_same_band_raises_the_threshold() {
    // Slopes of masking between 0.65 and 1 are what people show (Legge & Foley 1980; Daly 1993).
    let vdp = Vdp::default();
    let frequency = 1.0 / 6.0;
    let alone = threshold(&vdp, frequency, 0.0, &[]);
    let raised = |times: f64| threshold(&vdp, frequency, 0.0, &[(times * alone, frequency, 0.0)]) / alone;
    let (faint, low, high) = (raised(0.02), raised(0.5), raised(4.0));
    assert!((0.9..1.1).contains(&faint), "{faint}");
    // (1 + (k₁k₂·½)⁴)^¼ for a slope of 1, with k₁k₂ = 6.
    assert!((low / 82f64.powf(0.25) - 1.0).abs() < 0.05, "{low}");
    let slope = (high / low).ln() / 8f64.ln();
    assert!((0.7..1.05).contains(&slope), "{low} {high}: {slope}");
}

#[test]
fn a_mask_of_another_band_does_not() {
    let vdp = Vdp::default();
    let frequency = 1.0 / 6.0;
    let alone = threshold(&vdp, frequency, 0.0, &[]);
    for mask in [(20.0 * alone, frequency, std::f64::consts::FRAC_PI_2), (20.0 * alone, frequency / 4.0, 0.0)]
    {
        let raised = threshold(&vdp, frequency, 0.0, &[mask]) / alone;
        assert!((0.8..1.25).contains(&raised), "{mask:?}: {raised}");
    }
}

fn noisy(width: usize, height: usize, sigma: f64, seed: u64) -> Vec<Rgb> {
    let mut noise = Noise::new(seed);
    (0..width * height).map(|_| [(0.5 + sigma * noise.normal()) as f32; 3]).collect()
}

#[test]
fn noise_is_seen_the_more_the_stronger_it_is() {
    let vdp = Vdp::default();
    let clean = noisy(64, 48, 0.0, 1);
    fn image(pixels: &[Rgb]) -> DisplayPixels<'_> {
        DisplayPixels::new(64, 48, pixels).unwrap()
    }
    let means = [0.0, 0.002, 0.01, 0.05, 0.2].map(|sigma| {
        let noise = noisy(64, 48, sigma, 1);
        let map = vdp.visible(&image(&clean), &image(&noise)).unwrap();
        assert_eq!(map, vdp.visible(&image(&noise), &image(&clean)).unwrap());
        map.mean()
    });
    assert!(means[0] == 0.0 && means.is_sorted() && means[1] < 0.01 && means[4] > 0.95, "{means:?}");
}

#[test]
fn any_size_and_any_pixel_will_do() {
    let vdp = Vdp::default();
    let odd = [[f32::NAN; 3], [f32::INFINITY; 3], [-1.0; 3], [1e30; 3], [0.0; 3], [1.0; 3]];
    for (width, height) in [(1, 1), (1, 70), (5, 3), (33, 17)] {
        let pixels: Vec<Rgb> = (0..width * height).map(|i| odd[i % odd.len()]).collect();
        let black = vec![[0.0; 3]; width * height];
        let [a, b] = [&pixels, &black].map(|pixels| DisplayPixels::new(width, height, pixels).unwrap());
        let map = vdp.visible(&a, &b).unwrap();
        assert!(map.values.iter().all(|p| (0.0..=1.0).contains(p)), "{width}×{height}");
        assert_eq!(vdp.visible(&a, &a).unwrap().max(), 0.0);
    }
    let (a, b) = (vec![[0.0; 3]; 6], vec![[0.0; 3]; 6]);
    let differ = vdp.visible(&DisplayPixels::new(2, 3, &a).unwrap(), &DisplayPixels::new(3, 2, &b).unwrap());
    assert_eq!(differ.unwrap_err(), MetricError::Differ((2, 3), (3, 2)));
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let (a, b) = (noisy(100, 60, 0.02, 1), noisy(100, 60, 0.02, 2));
    let [a, b] = [&a, &b].map(|pixels| DisplayPixels::new(100, 60, pixels).unwrap());
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Vdp::default().visible(&a, &b).unwrap())
    };
    assert_eq!(run(1), run(3));
}
