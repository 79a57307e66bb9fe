use super::super::rendering::stages;
use super::*;
use noisefloor::{Film, Tile, TileGrid, display::luminance};
use noisefloor_learn::Patch;

const EDGE: usize = 200;
const MEAN: f64 = 0.5;
/// Standard deviation of one sample.
const SIGMA: f64 = 0.4;

/// A picture of grey noise around the mean.
fn grey(samples: f64, noise: &mut fastrand::Rng) -> Vec<Rgb> {
    let normal = |noise: &mut fastrand::Rng| {
        let (u, v) = (1.0 - noise.f64(), noise.f64());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    };
    (0..EDGE * EDGE).map(|_| [(MEAN + SIGMA / samples.sqrt() * normal(noise)) as f32; 3]).collect()
}

fn image(first: u64, last: u64, pixels: Vec<Rgb>) -> JudgedImage {
    let inner = Tile { index: 0, x: 0, y: 0, width: EDGE, height: EDGE };
    let patch = Patch { width: EDGE, height: EDGE, pixels, inner };
    let (scene, encoding) = ("s".into(), Encoding::Linear);
    JudgedImage { scene, zone: 3, first, last, encoding, rounding: 0.0, patch }
}

/// From batches of ten samples, and one of very many, which is truth and no realisation.
fn noise_of(count: u64) -> Noise {
    let mut random = fastrand::Rng::with_seed(count);
    let mut levels: Vec<JudgedImage> =
        (0..count).map(|i| image(10 * i, 10 * i + 10, grey(10.0, &mut random))).collect();
    levels.push(image(10 * count, 1_000_000, grey(1e6, &mut random)));
    let noise = Noise::of(&levels).unwrap();
    assert_eq!(noise.realisations.len(), count as usize);
    noise
}

fn mean_square(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|v| v * v).sum::<f64>() / (EDGE * EDGE) as f64
}

/// What a criterion can look at, stage by stage, each over what σ²/n says of it.
#[derive(Debug)]
struct Seen {
    mean: f64,
    halves: f64,
    between_batches: f64,
    snapshots: Option<f64>,
    batches: usize,
}

fn follow(noise: &Noise, batch: impl Fn(usize, u64) -> Vec<Rgb>) -> Vec<Seen> {
    let mut film = Film::new(TileGrid::new(EDGE, EDGE, EDGE).unwrap());
    let tile = film.grid().tile(0);
    let level = |p: Rgb| f64::from(luminance(p));
    // Σnᵢbᵢ² of each pixel, b without the mean of the picture
    let mut squares = vec![0.0f64; EDGE * EDGE];
    let (mut turn, mut kept): (usize, Vec<(f64, Vec<f64>)>) = (0, Vec::new());
    let truth: Vec<f64> = noise.converged.iter().map(|&p| level(p)).collect();
    let mut seen = Vec::new();
    for batches in stages(20.0, 4000.0) {
        for samples in batches {
            let batch = batch(turn, samples);
            for ((square, &value), truth) in squares.iter_mut().zip(&batch).zip(&truth) {
                *square += samples as f64 * (level(value) - truth).powi(2);
            }
            film.add(0, samples, &batch).unwrap();
            turn += 1;
        }
        let n = film.spp(0) as f64;
        let [a, b] = film.half_counts(0).map(|n| n as f64);
        assert!((a - b).abs() <= kept.len() as f64 + 1.0, "halves of {a} and {b}");
        let now: Vec<f64> = film.image().iter().zip(&truth).map(|(&p, truth)| level(p) - truth).collect();
        let halves = tile.rows(EDGE).flatten().map(|p| {
            let [(a, _), (b, _)] = film.pixel_halves(0, p);
            level(a) - level(b)
        });
        // Σnᵢ(bᵢ − M)² = Σnᵢbᵢ² − nM²
        let between = squares.iter().zip(&now).map(|(s, m)| s - n * m * m).sum::<f64>();
        let before = kept.iter().rev().find(|(m, _)| 2.0 * m <= n);
        let variance = SIGMA * SIGMA;
        seen.push(Seen {
            mean: mean_square(now.iter().copied()) / (variance / n),
            halves: mean_square(halves) / (variance * (1.0 / a + 1.0 / b)),
            between_batches: between / (EDGE * EDGE) as f64 / (turn - 1) as f64 / variance,
            snapshots: before.map(|(m, then)| {
                let change = now.iter().zip(then).map(|(a, b)| a - b);
                mean_square(change) / (variance * (1.0 / m - 1.0 / n))
            }),
            batches: turn,
        });
        kept.push((n, now));
    }
    seen
}

/// At every stage, for as few realisations as two: the mean of the film, the difference of its halves, the
/// variance between batches, and the difference from the snapshot with half of the samples.
#[test]
fn whatever_a_criterion_looks_at_has_the_noise_of_its_samples() {
    let (pixels, blocks) = ((EDGE * EDGE) as f64, (EDGE / BLOCK).pow(2) as f64);
    for count in [2u64, 4, 8] {
        let k = count as f64;
        // K realisations of so many pixels have a variance that errs by √(2/PK). Those of a block of B pixels
        // correlate by 1/√B: in the K(K − 1)/2 products, twice each, with signs at random, √(2/BM).
        let batch = (2.0 / (pixels * k) + 2.0 / pixels).sqrt();
        // And the energy of a walk over K realisations by √(2/K) in each block.
        let sum = (2.0 / (k * blocks) + batch * batch).sqrt();
        let noise = noise_of(count);
        let seen = follow(&noise, |turn, samples| noise.batch(turn, samples));
        assert!(seen.len() > 35, "{}", seen.len());
        for (stage, seen) in seen.iter().enumerate() {
            // Four standard errors, 6e-5 by chance; of these 500 numbers at most 50 are independent: 0.3 %
            let near = |what: &str, ratio: f64, error: f64| {
                assert!(
                    (ratio - 1.0).abs() < 4.0 * error,
                    "{count}, stage {stage}, {what}: {ratio} ± {error}"
                );
            };
            near("mean", seen.mean, sum);
            near("halves", seen.halves, sum);
            let others = (seen.batches - 1) as f64;
            near("between batches", seen.between_batches, batch * (1.0 + 1.0 / others) + sum / others);
            seen.snapshots.iter().for_each(|&ratio| near("snapshots", ratio, sum));
        }
    }
}

/// Realisations that take turns, and change their sign after each round, cancel each other in the film: what an
/// earlier version did, and what the test above has to find.
#[test]
fn realisations_in_turns_lose_noise() {
    for count in [2u64, 4, 8] {
        let noise = noise_of(count);
        let seen = follow(&noise, |turn, samples| {
            let sign = if (turn / count as usize).is_multiple_of(2) { 1.0 } else { -1.0 };
            let realisation = &noise.realisations[turn % count as usize];
            combine(&noise.converged, 1.0, realisation, sign / (samples as f64).sqrt())
        });
        let late: Vec<f64> = seen.iter().skip(10).map(|seen| seen.mean).collect();
        let least = late.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(least < 0.5, "{count}: {least}");
    }
}

/// Of pixels that a box of two filters, neighbours correlate by a half; the border of every block loses one pair.
#[test]
fn neighbours_stay_correlated_in_a_block() {
    let mut random = fastrand::Rng::with_seed(5);
    let mut levels = Vec::new();
    for i in 0..4u64 {
        let white = grey(10.0, &mut random);
        let beside =
            |p: usize| (white[p][0] + white[if p.is_multiple_of(EDGE) { p } else { p - 1 }][0]) / 2.0;
        levels.push(image(10 * i, 10 * i + 10, (0..EDGE * EDGE).map(|p| [beside(p); 3]).collect()));
    }
    levels.push(image(40, 1_000_000, vec![[MEAN as f32; 3]; EDGE * EDGE]));
    let noise = Noise::of(&levels).unwrap();
    let batch = noise.batch(2, 100);
    let off: Vec<f64> =
        batch.iter().zip(&noise.converged).map(|(b, c)| f64::from(b[0]) - f64::from(c[0])).collect();
    let rows = || off.chunks(EDGE).flat_map(|row| row.windows(2));
    let correlation = rows().map(|w| w[0] * w[1]).sum::<f64>() / rows().map(|w| w[0] * w[0]).sum::<f64>();
    // Of 199 pairs in a row 24 cross a border; four times 1/√40,000, which is 0.5 %
    let expected = 0.5 * (1.0 - 24.0 / 199.0);
    assert!((correlation - expected).abs() < 0.02, "{correlation} {expected}");
}

/// Parts of nested means are told apart, and those that are mostly truth or rounding are left out.
#[test]
fn nested_means_give_the_samples_between_them() {
    let mut random = fastrand::Rng::with_seed(7);
    let (mut sum, mut count) = (vec![0.0f32; EDGE * EDGE], 0u64);
    let mut levels = Vec::new();
    for last in [10u64, 20, 40, 42, 1000] {
        let new = grey((last - count) as f64, &mut random);
        sum.iter_mut().zip(&new).for_each(|(sum, new)| *sum += (last - count) as f32 * new[0]);
        count = last;
        levels.push(image(0, last, sum.iter().map(|s| [s / last as f32; 3]).collect()));
    }
    let noise = Noise::of(&levels).unwrap();
    assert_eq!(noise.realisations.len(), 3, "10, 10 and 20 samples; 2 are amplified rounding, 958 truth");
    for realisation in &noise.realisations {
        let variance = mean_square(realisation.iter().map(|p| f64::from(p[0]))) / (SIGMA * SIGMA);
        // 4·√(2/40,000) = 2.8 %
        assert!((variance - 1.0).abs() < 0.028, "{variance}");
    }
}
