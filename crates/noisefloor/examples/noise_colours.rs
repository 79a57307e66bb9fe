//! What the bundled model makes of noise unlike that of its training data: for each kind, the samples it asks
//! for, where independent noise *of equal visibility* gets four times what it has. Prints a table in
//! Markdown.
//!
//! Equal visibility is that of an observer who is not ours: noise energy weighted by the squared contrast
//! sensitivity of Mannos and Sakrison 1974, A(f) = 2.6·(0.0192 + 0.114 f)·exp(−(0.114 f)^1.1), f in cycles
//! per degree, at 40 pixels per degree. No person has looked at these pictures.

#![allow(clippy::print_stdout, reason = "a table for people")]

use ndarray::Array2;
use noisefloor::{Oracle, TileGrid, evidence::TilePlanes};
use std::f64::consts::TAU;

const SIZE: usize = 256;
const TILE: usize = 128;
const PIXELS_PER_DEGREE: f64 = 40.0;
/// Samples per pixel the pictures are said to have.
const SAMPLES: f64 = 100.0;
const SEEDS: u64 = 3;
/// Least half-width of kernels that hold a Gaussian of σ = 2.
const REACH: isize = 6;

/// How noise is made from independent normal numbers.
struct Kind {
    name: &'static str,
    /// Weight of the number at distance (dx, dy).
    kernel: fn(isize, isize) -> f64,
    /// Correlation of the two halves with each other.
    shared: f64,
    /// One in so many pixels has all the noise; 1 for normal noise.
    sparse: u64,
}

fn at_centre(dx: isize, dy: isize) -> f64 {
    if (dx, dy) == (0, 0) { 1.0 } else { 0.0 }
}

fn gaussian(sigma: f64, dx: isize, dy: isize) -> f64 {
    (-((dx * dx + dy * dy) as f64) / (2.0 * sigma * sigma)).exp()
}

/// Weight of a Gaussian among all its neighbours.
fn normalised(sigma: f64, dx: isize, dy: isize) -> f64 {
    let sum: f64 = offsets().map(|(x, y)| gaussian(sigma, x, y)).sum();
    gaussian(sigma, dx, dy) / sum
}

fn offsets() -> impl Iterator<Item = (isize, isize)> {
    (-REACH..=REACH).flat_map(|y| (-REACH..=REACH).map(move |x| (x, y)))
}

const KINDS: [Kind; 8] = [
    Kind { name: "independent", kernel: at_centre, shared: 0.0, sparse: 1 },
    Kind { name: "fireflies: 1 % of the pixels have all of it", kernel: at_centre, shared: 0.0, sparse: 100 },
    Kind {
        name: "blue: independent less its Gaussian, σ = 1",
        kernel: |x, y| at_centre(x, y) - normalised(1.0, x, y),
        shared: 0.0,
        sparse: 1,
    },
    Kind {
        name: "splatted through a tent of two pixels",
        kernel: |x, y| (2 - x.abs()).max(0) as f64 * (2 - y.abs()).max(0) as f64,
        shared: 0.0,
        sparse: 1,
    },
    Kind { name: "blotches, σ = 1", kernel: |x, y| gaussian(1.0, x, y), shared: 0.0, sparse: 1 },
    Kind { name: "blotches, σ = 2", kernel: |x, y| gaussian(2.0, x, y), shared: 0.0, sparse: 1 },
    Kind {
        name: "Metropolis-like: blotches, σ = 1, halves correlated by 0.5",
        kernel: |x, y| gaussian(1.0, x, y),
        shared: 0.5,
        sparse: 1,
    },
    Kind { name: "quasi-random: halves correlated by −0.5", kernel: at_centre, shared: -0.5, sparse: 1 },
];

/// Noise energy as the observer sees it, of a kernel on independent numbers of variance 1.
fn visible(kernel: fn(isize, isize) -> f64) -> f64 {
    const N: usize = 48;
    let mut sum = 0.0;
    for v in 0..N {
        for u in 0..N {
            // Cycles per pixel, −½…½
            let f = [u, v].map(|i| (i as f64 + 0.5) / N as f64 - 0.5);
            let (mut re, mut im) = (0.0, 0.0);
            for (x, y) in offsets() {
                let phase = TAU * (f[0] * x as f64 + f[1] * y as f64);
                re += kernel(x, y) * phase.cos();
                im += kernel(x, y) * phase.sin();
            }
            let cycles = 0.114 * f[0].hypot(f[1]) * PIXELS_PER_DEGREE;
            let sensitivity = 2.6 * (0.0192 + cycles) * (-cycles.powf(1.1)).exp();
            sum += (re * re + im * im) * sensitivity * sensitivity;
        }
    }
    sum / (N * N) as f64
}

/// Display value at a pixel.
type Picture = fn(usize, usize) -> f64;

/// Its sequence is that of the published table, which is why it is not the testkit's `Noise`.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Mean 0, variance 1.
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }

    /// As normal, in one of `sparse` pixels.
    fn draw(&mut self, sparse: u64) -> f64 {
        let here = sparse == 1 || self.uniform() * (sparse as f64) < 1.0;
        let value = self.normal();
        if here { value * (sparse as f64).sqrt() } else { 0.0 }
    }
}

fn shaped(kind: &Kind, random: &mut Random) -> Array2<f64> {
    let raw = Array2::from_shape_simple_fn((SIZE, SIZE), || random.draw(kind.sparse));
    let weights: Vec<_> =
        offsets().map(|(x, y)| (x, y, (kind.kernel)(x, y))).filter(|&(.., w)| w != 0.0).collect();
    let wrap = |at: usize, by: isize| (at as isize + by).rem_euclid(SIZE as isize) as usize;
    Array2::from_shape_fn((SIZE, SIZE), |(y, x)| {
        weights.iter().map(|&(dx, dy, w)| w * raw[(wrap(y, dy), wrap(x, dx))]).sum()
    })
}

/// Samples the model asks for, over those that are there: geometric mean over tiles and seeds. `amplitude` is
/// that of the noise of the mean of both halves, in display values.
fn asked(oracle: &Oracle, kind: &Kind, clean: Picture, amplitude: f64) -> f64 {
    let grid = TileGrid::new(SIZE, SIZE, TILE).expect("a valid grid");
    let (mut sum, mut count) = (0.0, 0.0);
    for seed in 1..=SEEDS {
        let mut random = Random(seed);
        let [common, a, b] = [(); 3].map(|()| shaped(kind, &mut random));
        let (own, both) = ((1.0 - kind.shared.abs()).sqrt(), kind.shared.abs().sqrt());
        let a = &a * own + &common * both;
        let b = &b * own + &common * (both * kind.shared.signum());
        // The mean of two halves has half of their variance, and of what they share.
        let of_mean = (0.5 * (1.0 + kind.shared)).sqrt();
        let (noise, half_difference) = ((&a + &b) * (0.5 / of_mean), (&a - &b) * (0.5 / of_mean));
        let described: Vec<_> = grid
            .tiles()
            .map(|tile| {
                let planes = TilePlanes::gather((SIZE, SIZE), tile, |x, y| {
                    let shown = clean(x, y) + amplitude * noise[(y, x)];
                    ([shown as f32; 3], [(amplitude * half_difference[(y, x)]) as f32; 3])
                });
                oracle.describe(&planes, SAMPLES).expect("any tile")
            })
            .collect();
        for verdict in oracle.judge_described(&described) {
            if let Some(expected) = verdict.expected_spp {
                sum += (expected as f64 / SAMPLES).ln();
                count += 1.0;
            }
        }
    }
    (sum / count).exp()
}

fn main() {
    let oracle = Oracle::bundled();
    let flat = |_: usize, _: usize| 0.5;
    let checker = |x: usize, y: usize| 0.5 + if (x / 6 + y / 6).is_multiple_of(2) { 0.03 } else { -0.03 };
    let pictures: [(&str, Picture); 2] = [("flat", flat), ("checker", checker)];
    println!("| noise | {} |", pictures.map(|p| p.0).join(" | "));
    println!("|---|{}", "---|".repeat(pictures.len()));
    let independent = visible(at_centre);
    let mut reference = Vec::new();
    for kind in &KINDS {
        let factor = (independent / visible(kind.kernel)).sqrt();
        let mut row = String::new();
        for (i, (_, clean)) in pictures.iter().enumerate() {
            if reference.len() == i {
                // The amplitude of independent noise that is asked for four times the samples
                let (mut low, mut high) = (1e-3, 0.3);
                for _ in 0..14 {
                    let middle = f64::sqrt(low * high);
                    if asked(&oracle, kind, *clean, middle) < 4.0 { low = middle } else { high = middle }
                }
                reference.push(low);
            }
            row += &format!(" ×{:.2} |", asked(&oracle, kind, *clean, reference[i] * factor) / 4.0);
        }
        println!("| {} |{row}", kind.name);
    }
}
