//! Held to ColorVideoVDP 0.5.7: values recorded by `record_cvvdp.py`, which makes the same pictures.
#![allow(missing_docs, reason = "tests")]

use noisefloor_vision::{Viewing, VisionModel, VisionWorkspace};
use serde::Deserialize;

#[derive(Deserialize)]
struct Recorded {
    pairs: Vec<Pair>,
    films: Vec<Film>,
}

#[derive(Deserialize)]
struct Pair {
    width: u32,
    height: u32,
    pattern: String,
    low: [i64; 3],
    high: [i64; 3],
    amount: [i64; 3],
    grain: u32,
    grey: bool,
    scale: f32,
    seed: u32,
    viewing: String,
    #[serde(default)]
    jod: f64,
    #[serde(default)]
    mean: f64,
    #[serde(default)]
    rms: f64,
    #[serde(default)]
    sample: Vec<f64>,
}

#[derive(Deserialize)]
struct Film {
    #[serde(flatten)]
    frame: Pair,
    /// Amounts of noise that all frames have in common.
    standing: [i64; 3],
    rate: f64,
    /// JODs lost by the film in video mode, and by its first frame with the noise times the gain of each channel.
    video: f64,
    by_frame: f64,
    map_rms: f64,
}

/// Frames that a film is judged by.
const FRAMES: u32 = 4;

/// Noise over a picture: its amounts, and its seed.
type Noise = ([i64; 3], u32);

/// 32 random bits of a place.
fn hashed(x: u32, y: u32, channel: u32, seed: u32) -> u32 {
    let mut h = x.wrapping_mul(0x9E37_79B1)
        ^ y.wrapping_mul(0x85EB_CA77)
        ^ channel.wrapping_mul(0xC2B2_AE3D)
        ^ seed.wrapping_mul(0x27D4_EB2F);
    for (shift, factor) in [(15, 0x2C1B_3C6D), (12, 0x297A_2D39)] {
        h = (h ^ (h >> shift)).wrapping_mul(factor);
    }
    h ^ (h >> 15)
}

impl Pair {
    /// 0 to 255.
    fn pattern(&self, x: u32, y: u32) -> i64 {
        let (width, height) = (i64::from(self.width), i64::from(self.height));
        let (column, row) = (i64::from(x), i64::from(y));
        let distance =
            || (2 * column - width).pow(2) * height * height + (2 * row - height).pow(2) * width * width;
        let all = (width * height).pow(2);
        match self.pattern.as_str() {
            "flat" => 128,
            "ramp" => 255 * (column + row) / (width + height),
            "bars" => (column / 5 + row / 9) % 2 * 255,
            "disc" if 2 * distance() < all => 230,
            "disc" => 40,
            "bowl" => (255 * distance() / (2 * all)).min(255),
            "mosaic" => i64::from(hashed(x / 3, y / 3, 7, 1) >> 24),
            other => panic!("no pattern is called {other}"),
        }
    }

    fn code(&self, x: u32, y: u32, channel: usize, noises: &[Noise]) -> f32 {
        let (low, high) = (self.low[channel], self.high[channel]);
        let mut code = low + ((high - low) * self.pattern(x, y)).div_euclid(255);
        for (amounts, seed) in noises {
            let amount = amounts[channel];
            let of = if self.grey { 0 } else { channel as u32 };
            let h = hashed(x / self.grain, y / self.grain, of, *seed);
            code += i64::from((h & 0xFFFF) + (h >> 16)) * (2 * amount + 1) / 131_071 - amount;
        }
        code.clamp(0, 255) as f32 / 255.0 * self.scale
    }

    fn picture(&self, noises: &[Noise]) -> Vec<[f32; 3]> {
        let places = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        places.map(|(x, y)| std::array::from_fn(|channel| self.code(x, y, channel, noises))).collect()
    }
}

fn recorded() -> Recorded {
    serde_json::from_str(include_str!("cvvdp.json")).expect("as recorded")
}

#[test]
fn jod_and_map_are_those_of_cvvdp() {
    // Asked for are 0.01 JOD and 1 %; single precision leaves a tenth of that, and more would be a mistake
    let mut workspace = VisionWorkspace::default();
    let pairs = recorded().pairs;
    assert!(pairs.len() >= 60);
    let mut wrong = Vec::new();
    let (mut worst_jod, mut worst_map) = (0.0f64, 0.0f64);
    for (number, pair) in pairs.iter().enumerate() {
        let viewing: Viewing = pair.viewing.parse().expect("conditions");
        let size = (pair.width as usize, pair.height as usize);
        let model = VisionModel::new(&viewing);
        let (test, reference) = (pair.picture(&[(pair.amount, pair.seed)]), pair.picture(&[]));
        let mut found = model.compare(&test, &reference, size, &mut workspace).expect("two pictures");
        let jod = found.jod();
        let map = found.map();
        let place = |i: usize, n: usize| (2 * i + 1) * n / 16;
        let sample = (0..64).map(|i| map[place(i / 8, size.1) * size.0 + place(i % 8, size.0)]);
        let square: f64 = sample.zip(&pair.sample).map(|(a, b)| (f64::from(a) - b).powi(2)).sum();
        let all: f64 = pair.sample.iter().map(|b| b * b).sum();
        let mean = map.iter().copied().map(f64::from).sum::<f64>() / map.len() as f64;
        let rms = (map.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>() / map.len() as f64).sqrt();
        // cvvdp's map ends in 1 − JOD/10 in single precision, which leaves noise of 6·10⁻⁷ JOD
        let error = (square / 64.0).sqrt() / ((all / 64.0).sqrt() + 1e-4);
        let off = |a: f64, b: f64| (a - b).abs() / (b + 1e-4);
        (worst_jod, worst_map) = (worst_jod.max((jod - pair.jod).abs()), worst_map.max(error));
        let map_off = error.max(off(mean, pair.mean)).max(off(rms, pair.rms));
        if (jod - pair.jod).abs() > 0.001 || map_off > 0.002 {
            wrong.push(format!(
                "pair {number} ({}×{} {} on {}): {jod:.5} JOD for {:.5}, map off by {error:.4}, \
                 its mean {mean:.6} for {:.6}, its root mean square {rms:.6} for {:.6}",
                pair.width, pair.height, pair.pattern, pair.viewing, pair.jod, pair.mean, pair.rms
            ));
        }
    }
    println!("{} pairs, at worst {worst_jod:.5} JOD off, maps by {:.3} %", pairs.len(), 100.0 * worst_map);
    assert!(wrong.is_empty(), "{} of {} pairs:\n{}", wrong.len(), pairs.len(), wrong.join("\n"));
}

/// One frame stands for a film: to the digits of single precision for what the package makes of the same frame with
/// the same gains, and within 0.05 JOD for what it makes of the film, unless that loses more than 2. The noise here has no tails.
#[test]
fn a_frame_of_a_film_is_judged_as_the_film() {
    let mut workspace = VisionWorkspace::default();
    let films = recorded().films;
    assert!(films.len() >= 20);
    let (mut worst_frame, mut worst_film) = (0.0f64, 0.0f64);
    for film in &films {
        let Film { frame, standing, rate, .. } = film;
        let viewing: Viewing = frame.viewing.parse().expect("conditions");
        let model = VisionModel::new(&viewing.with_frames_per_second(Some(*rate)).expect("a rate"));
        let size = (frame.width as usize, frame.height as usize);
        let same = (*standing, frame.seed);
        let (reference, standing) = (frame.picture(&[]), frame.picture(&[same]));
        let mut rms = Vec::new();
        let mut lost_by = |number: u32| {
            let test = frame.picture(&[same, (frame.amount, frame.seed + number)]);
            let mut found =
                model.compare_frame(&test, &standing, &reference, size, &mut workspace).expect("pictures");
            let map = found.map();
            rms.push((map.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>() / map.len() as f64).sqrt());
            10.0 - found.jod()
        };
        // Whole frames differ in brightness by chance, which flickers
        let by_frames: Vec<f64> = (1..=FRAMES).map(&mut lost_by).collect();
        let (lost, rms) = (by_frames[0], rms[0]);
        let mean = by_frames.iter().sum::<f64>() / f64::from(FRAMES);
        let what = format!("{} at {rate} per second, amounts {:?}", frame.pattern, frame.amount);
        assert!((lost - film.by_frame).abs() < 0.001, "{what}: {lost} for {}", film.by_frame);
        assert!(
            (rms - film.map_rms).abs() < 0.002 * (film.map_rms + 0.01),
            "{what}: {rms} for {}",
            film.map_rms
        );
        // Noise that is cut off at black and white is not the same in space once it is filtered
        assert!(
            (mean - film.video).abs() < if film.video < 2.0 { 0.05 } else { 0.1 },
            "{what}: {mean} for {}",
            film.video
        );
        worst_frame = worst_frame.max((lost - film.by_frame).abs());
        worst_film = worst_film.max((mean - film.video).abs());
    }
    println!("{} films, at worst {worst_frame:.5} JOD off by frame, {worst_film:.3} by film", films.len());
}
