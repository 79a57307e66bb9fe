//! Tests that cross crates, and [`check_source`]: the contract of a source of samples, to be run on every one, and on yours.

use noisefloor::{
    Batch, Oracle, ProgressiveSource, Reference, Rendering, Repeats, Request, Samples, SourceInfo, Tile,
    TileGrid, TilePlanes, ToneMapping, Unit, check_image,
};
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::cmp::Ordering;

/// Tile edge that sources are asked in: an image of 48×40 pixels has ragged tiles to the right and below.
const EDGE: usize = 32;
/// Largest correlation, in the unit of its standard error, that passes for chance.
const LARGEST_Z: f64 = 6.0;
/// Relative differences below this are rounding, not noise: about 64 roundings to f32.
const ROUNDING: f64 = 64.0 / (1 << 24) as f64;
/// Rounds of 16 samples that are looked at for independence, of samples and of mutations.
const ROUNDS: [usize; 2] = [4, 64];
/// Batches of 32 samples that are held against as many in four parts.
const LONG: usize = 12;
/// False-alarm rate of each comparison of those.
const FALSE_ALARM: f64 = 1e-8;
/// Most batches that a playback is followed for, and a renderer.
const MOST_BATCHES: [usize; 2] = [1000, 8];

/// Checks all that a [`ProgressiveSource`] promises. `make` makes a source, the same one each time: same scene, same seed.
///
/// ```
/// # use noisefloor::*;
/// # struct Wall;
/// # impl ProgressiveSource for Wall {
/// #     fn info(&self) -> SourceInfo {
/// #         SourceInfo { name: "wall".into(), width: 48, height: 40, unit: Unit::SamplesPerPixel, aims: true, repeats: Repeats::Samples }
/// #     }
/// #     fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
/// #         Ok(requests.iter().map(|r| Batch { tile: r.tile, spp: r.spp, mean: vec![[0.2; 3]; r.tile.pixels()] }).collect())
/// #     }
/// # }
/// noisefloor_testkit::check_source(|| Wall);
/// ```
///
/// # What is checked
/// - The description is in range, does not change with use, and is the same for every source that `make` makes.
/// - One batch a request, in the order of the requests, with the tile asked for and a value a pixel. No request, no batch.
/// - Counts are exact: a renderer gives what is asked for until it ends; a playback gives what it has, whatever is asked for.
///   Which of the two a source is, is told by its counts.
/// - What [`SourceInfo::repeats`] promises. [`Repeats::Calls`]: the same construction gives the same samples to the bit.
///   [`Repeats::Samples`]: also, how requests are cut changes rounding alone (8 + 24 samples are the 32 samples asked for at
///   once), and tiles asked for alone, or at other depths than their neighbours, get what they get when all are asked for.
/// - However requests are cut, the distribution is the same: 12 batches of 32 samples against 12 of 8 + 8 + 8 + 8.
/// - Batches of new samples are independent of those before, in the same tile and in others.
/// - The reference, if there is one, has the image's size and is finite; rendering it changes no sample. Whether it is free of
///   noise takes two seeds: [`check_reference_is_free_of_noise`].
/// - At its end a source gives empty batches, again and again.
///
/// A playback is not cut, nor asked for single tiles at other depths.
///
/// Use an image with more than one tile of 32×32 pixels, both edges no multiple of 32: 48×40 is enough, and quick. A correlation
/// is found from a few dozen noisy pixels on.
///
/// # How often a right source fails by chance
/// *Independence.* Noise of a pixel is the difference x of two batches of equally many samples, which is symmetric around 0; so is
/// that of two others, y. Given all |xy|, only signs are left to chance, independent from pixel to pixel, and z = Σxy/√Σ(xy)²
/// exceeds 6 with p ≤ 2·exp(−6²/2) = 3.1e-8 (Hoeffding 1963), whatever the distribution. Four such z are looked at: p < 1.3e-7 a
/// source. Batches of a playback are not of equal size; for them this holds as far as z is normal. Where work is counted in
/// mutations, neighbouring pixels share a Markov chain: signs are then those of whole tiles, in 64 batches instead of 4.
///
/// *Distribution.* Two numbers a batch, the mean over its pixels and the mean square of its deviations (each pixel's in units of
/// its own standard deviation over all batches), are compared by Welch's t (1947), with the two-sided quantile of p = 1e-8. Where
/// work is counted in samples, pixels are independent, and so are the ranks, among the 24 batches, that the long ones have in
/// each: their cumulative frequencies (the Kolmogorov–Smirnov comparison, pixel by pixel) are off by 6 standard errors with
/// p < 2e-9 each, 23 of them, by the normal approximation. Together p < 1e-7 a source.
///
/// The sources of this project are seeded where their renderers are: they pass always or never.
///
/// # Panics
/// If a promise is not kept; the message says which.
pub fn check_source<S: ProgressiveSource>(make: impl Fn() -> S) {
    // A description that holds for every source made, before and after use
    let info = make().info();
    check_info(&info);
    let start = || {
        let source = make();
        assert_eq!(source.info(), info, "two sources of one construction describe themselves differently");
        Probe::new(source)
    };
    let rounds = |samples: &[u64]| {
        let mut probe = start();
        let rounds = samples.iter().map(|&n| probe.ask_all(n)).collect::<Vec<_>>();
        assert_eq!(probe.source.info(), info, "the description changed with use");
        rounds
    };

    // Exact counts
    let (eight, three) = (rounds(&[8]), rounds(&[3]));
    let playback = !(gives(&eight[0], 8) && gives(&three[0], 3));
    let several = rounds(&[16; ROUNDS[1]][..ROUNDS[usize::from(info.unit == Unit::MutationsPerPixel)]]);
    let four = &several[..4];
    if playback {
        let other = rounds(&[1, 1000, 5, 7]);
        assert!(same(four, &other), "a playback gave other batches because other numbers were asked for");
    } else {
        check_counts(four, &[16; 4]);
    }

    // Repeatable
    let promises = |least| info.repeats == Repeats::Samples || info.repeats == least;
    if promises(Repeats::Calls) {
        assert!(same(four, &rounds(&[16; 4])), "the same construction gave other samples the second time");
    }

    // However requests are cut, to the bit
    let whole = rounds(&[32]);
    if !playback {
        let parts = rounds(&[8, 24]);
        check_counts(&parts, &[8, 24]);
        if promises(Repeats::Samples) && gives(&parts[1], 24) {
            check_cut(&whole[0], &parts);
        }
    }
    if info.aims {
        check_aiming(start, four, promises(Repeats::Samples));
    }

    // Independent, and of one distribution
    check_independence(&several, (!playback).then_some(&whole[0]), info.unit);
    if !playback {
        let mut probe = start();
        let long: Vec<_> = (0..LONG).map(|_| probe.ask_all(32)).collect();
        let short: Vec<_> = (0..4 * LONG).map(|_| probe.ask_all(8)).collect();
        if gives(&short[4 * LONG - 1], 8) {
            check_distribution(&long, &short, info.unit);
        }
    }

    // The reference, which is nobody's sample
    let mut probe = start();
    check_reference(&mut probe.source, &info);
    let after = [probe.ask_all(16)];
    if promises(Repeats::Calls) {
        assert!(same(&after, &four[..1]), "rendering the reference changed the samples");
    }

    // The end, where it is near
    let mut probe = start();
    let over = |batches: &[Batch]| batches.iter().all(|b| b.spp == 0);
    let most = MOST_BATCHES[usize::from(!playback)];
    if (0..most).any(|_| over(&probe.ask_all(16))) {
        assert!(over(&probe.ask_all(16)), "after its end the source has samples again");
    }
}

/// A source, and how far each tile of it is.
struct Probe<S> {
    source: S,
    tiles: Vec<Tile>,
    taken: Vec<u64>,
}

impl<S: ProgressiveSource> Probe<S> {
    fn new(source: S) -> Self {
        let info = source.info();
        let grid = TileGrid::new(info.width, info.height, EDGE).expect("the size was checked");
        Self { source, tiles: grid.tiles().collect(), taken: vec![0; grid.len()] }
    }

    /// Asks for the next samples of some tiles, and checks the shape of the answer.
    fn ask(&mut self, tiles: &[usize], samples: u64) -> Vec<Batch> {
        let request = |&i: &usize| Request { tile: self.tiles[i], first: self.taken[i], spp: samples };
        let requests: Vec<Request> = tiles.iter().map(request).collect();
        let batches =
            self.source.sample(&requests).unwrap_or_else(|e| panic!("sampling failed: {e} ({e:?})"));
        assert_eq!(batches.len(), requests.len(), "number of batches, for so many requests");
        for (request, batch) in requests.iter().zip(&batches) {
            let place = request.tile.index;
            assert_eq!(batch.tile, request.tile, "batches are not in the order of the requests");
            let pixels = if batch.spp == 0 { 0 } else { batch.tile.pixels() };
            assert_eq!(batch.mean.len(), pixels, "values in a batch of {} samples, tile {place}", batch.spp);
            self.taken[place] += batch.spp;
        }
        batches
    }

    /// Asks for all tiles, last first, and gives the batches in the order of the grid.
    fn ask_all(&mut self, samples: u64) -> Vec<Batch> {
        let order: Vec<usize> = (0..self.tiles.len()).rev().collect();
        let mut batches = self.ask(&order, samples);
        batches.reverse();
        batches
    }
}

fn check_info(info: &SourceInfo) {
    assert!(!info.name.trim().is_empty(), "a source needs a name, for reports and messages");
    check_image(info.width, info.height).unwrap_or_else(|e| panic!("{e}"));
}

fn gives(batches: &[Batch], samples: u64) -> bool {
    batches.iter().all(|b| b.spp == samples)
}

/// Equal to the bit, NaN and −0 included.
fn same(a: &[Vec<Batch>], b: &[Vec<Batch>]) -> bool {
    let bits = |batch: &Batch| -> Vec<u32> { batch.mean.iter().flatten().map(|c| c.to_bits()).collect() };
    let equal = |(a, b): (&Batch, &Batch)| a.tile == b.tile && a.spp == b.spp && bits(a) == bits(b);
    a.len() == b.len() && a.iter().flatten().zip(b.iter().flatten()).all(equal)
}

/// As asked, until the end: then what was left, and nothing from then on.
fn check_counts(rounds: &[Vec<Batch>], asked: &[u64]) {
    for tile in 0..rounds[0].len() {
        let mut ended = false;
        for (batches, &asked) in rounds.iter().zip(asked) {
            let samples = batches[tile].spp;
            let right = if ended { samples == 0 } else { samples <= asked };
            assert!(right, "tile {tile}: {samples} samples where {asked} were asked for");
            ended |= samples < asked;
        }
    }
}

/// The mean of the parts is the whole, but for rounding.
fn check_cut(whole: &[Batch], parts: &[Vec<Batch>]) {
    for (tile, all) in whole.iter().enumerate() {
        for (pixel, all) in all.mean.iter().enumerate() {
            for (c, &all) in all.iter().enumerate() {
                let [a, b] = [0, 1].map(|round: usize| f64::from(parts[round][tile].mean[pixel][c]));
                let (both, all) = ((8.0 * a + 24.0 * b) / 32.0, f64::from(all));
                let size = a.abs().max(b.abs()).max(f64::from(f32::MIN_POSITIVE));
                let close = (both - all).abs() <= ROUNDING * size || !(both.is_finite() && all.is_finite());
                assert!(
                    close,
                    "samples depend on how requests are cut: tile {tile}, pixel {pixel}: {both} in two batches, {all} in one"
                );
            }
        }
    }
}

/// Means over 32 samples have one distribution, asked for at once or in four parts.
fn check_distribution(long: &[Vec<Batch>], short: &[Vec<Batch>], unit: Unit) {
    let value = |p: &[f32; 3]| p.iter().map(|&c| f64::from(c)).sum::<f64>();
    let values =
        |batches: &Vec<Batch>| -> Vec<f64> { batches.iter().flat_map(|b| &b.mean).map(value).collect() };
    let mean = |parts: &[Vec<f64>]| -> Vec<f64> {
        (0..parts[0].len()).map(|i| parts.iter().map(|p| p[i]).sum::<f64>() / parts.len() as f64).collect()
    };
    let parts: Vec<_> = short.iter().map(values).collect();
    let batches: Vec<_> = long.iter().map(values).chain(parts.chunks(4).map(mean)).collect();

    // Noise alone, each pixel in its own unit. Pixels without noise, or with a sample that is not finite, have none to compare
    let centre = mean(&batches);
    let variance =
        |i: usize| batches.iter().map(|b| (b[i] - centre[i]).powi(2)).sum::<f64>() / batches.len() as f64;
    let noisy: Vec<(usize, f64)> = (0..centre.len())
        .map(|i| (i, variance(i).sqrt()))
        .filter(|&(i, deviation)| deviation.is_finite() && deviation > ROUNDING * centre[i].abs())
        .collect();
    if noisy.is_empty() {
        return;
    }
    let deviations =
        |b: &Vec<f64>| -> Vec<f64> { noisy.iter().map(|&(i, unit)| (b[i] - centre[i]) / unit).collect() };
    let batches: Vec<_> = batches.iter().map(deviations).collect();
    let level = |b: &Vec<f64>| b.iter().sum::<f64>() / b.len() as f64;
    let spread = |b: &Vec<f64>| b.iter().map(|d| d * d).sum::<f64>() / b.len() as f64;
    for (what, number) in [("mean", &level as &dyn Fn(&Vec<f64>) -> f64), ("noise", &spread)] {
        let numbers: Vec<f64> = batches.iter().map(number).collect();
        let (long, short) = numbers.split_at(LONG);
        assert!(
            welch(long, short) > FALSE_ALARM,
            "the {what} of 32 samples depends on how requests are cut: {long:.3?} at once, {short:.3?} in four parts"
        );
    }
    if unit == Unit::SamplesPerPixel {
        check_ranks(&batches);
    }
}

/// Probability that the means of two groups differ by as much, or more, by chance: Welch's t-test (1947), two-sided.
fn welch(a: &[f64], b: &[f64]) -> f64 {
    let [(mean_a, error_a, freedom_a), (mean_b, error_b, freedom_b)] = [a, b].map(|group| {
        let n = group.len() as f64;
        let mean = group.iter().sum::<f64>() / n;
        let variance = group.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, variance / n, n - 1.0)
    });
    let error = error_a + error_b;
    let freedom = error * error / (error_a * error_a / freedom_a + error_b * error_b / freedom_b);
    let t = StudentsT::new(0.0, 1.0, freedom).expect("noisy batches vary");
    2.0 * t.sf((mean_a - mean_b).abs() / error.sqrt())
}

/// The first half of the batches are no higher nor lower in each pixel than the second.
fn check_ranks(batches: &[Vec<f64>]) {
    let (all, pixels) = (batches.len(), batches[0].len());
    let mut below = vec![0.0; all];
    let of_pixel = |pixel: usize| batches.iter().map(|b| b[pixel]).collect::<Vec<f64>>();
    for (pixel, values) in (0..pixels).map(of_pixel).enumerate() {
        // Equal values have no rank of their own: their order is as good as chance, and chance must not know who they are
        let tie = |batch: usize| {
            (pixel as u64 * all as u64 + batch as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(32)
        };
        let mut order: Vec<usize> = (0..all).collect();
        order.sort_by(|&a, &b| {
            let by_value = values[a].partial_cmp(&values[b]).unwrap_or(Ordering::Equal);
            by_value.then_with(|| tie(a).cmp(&tie(b)))
        });
        for (rank, &batch) in order.iter().enumerate() {
            below[rank] += f64::from(u8::from(batch < all / 2));
        }
    }
    let mut sum = 0.0;
    for (rank, count) in below.iter().enumerate().take(all - 1) {
        // Of the lowest `drawn` of `all` batches, half of them long: hypergeometric
        sum += count;
        let (drawn, all) = ((rank + 1) as f64, all as f64);
        let variance = drawn * 0.25 * (all - drawn) / (all - 1.0) * pixels as f64;
        let z = (sum - drawn / 2.0 * pixels as f64) / variance.sqrt();
        assert!(
            z.abs() < LARGEST_Z,
            "the distribution of 32 samples depends on how requests are cut: z = {z} at quantile {:.2}",
            drawn / all
        );
    }
}

/// Tiles can be asked for alone. To the bit, they get the same samples then, and at whatever depth the others are.
fn check_aiming<S: ProgressiveSource>(start: impl Fn() -> Probe<S>, rounds: &[Vec<Batch>], to_the_bit: bool) {
    let mut probe = start();
    assert!(probe.ask(&[], 16).is_empty());
    let last = probe.tiles.len() - 1;
    let alone = probe.ask(&[last], 16);
    let together = probe.ask_all(16);
    if !to_the_bit {
        return;
    }
    assert!(
        same(&[alone], &[vec![rounds[0][last].clone()]]),
        "a tile asked for alone got other samples than in company"
    );
    for (tile, batch) in together.into_iter().enumerate() {
        let depth = usize::from(tile == last);
        let right = same(&[vec![batch]], &[vec![rounds[depth][tile].clone()]]);
        assert!(right, "tile {tile} got other samples because its neighbours are at another depth");
    }
}

/// Noise of two batches against noise of two others, in every way to pair four, and noise of a tile against the next one's.
fn check_independence(rounds: &[Vec<Batch>], whole: Option<&Vec<Batch>>, unit: Unit) {
    if rounds.iter().flatten().any(|b| b.spp == 0) {
        return;
    }
    let noise = |a: &Vec<Batch>, b: &Vec<Batch>| -> Vec<Vec<f64>> {
        a.iter().zip(b).map(|(a, b)| difference(a, b)).collect()
    };
    // Products whose signs are independent: pixel by pixel, or tile by tile
    let products = |pairs: Vec<(f64, f64)>| -> Vec<f64> {
        let products = pairs.into_iter().map(|(x, y)| x * y);
        if unit == Unit::SamplesPerPixel { products.collect() } else { vec![products.sum()] }
    };
    let mut silent = true;
    for [a, b, c, d] in [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2]] {
        let mut terms = Vec::new();
        for four in rounds.chunks_exact(4) {
            for (x, y) in noise(&four[a], &four[b]).into_iter().zip(noise(&four[c], &four[d])) {
                silent &= x.iter().chain(&y).all(|&v| v == 0.0);
                terms.extend(products(x.into_iter().zip(y).collect()));
            }
        }
        let z = z(&terms);
        assert!(
            z.abs() < LARGEST_Z,
            "successive batches are correlated: z = {z}; are they means of new samples alone?"
        );
    }

    // Without noise there is nothing to correlate. But then a batch of another size is the same too
    if let (true, Some(whole)) = (silent, whole) {
        let again = whole.iter().zip(&rounds[0]).flat_map(|(a, b)| difference(a, b)).any(|v| v != 0.0);
        assert!(!again, "every batch has the same samples again");
    }

    let mut terms = Vec::new();
    for four in rounds.chunks_exact(4) {
        let x = noise(&four[0], &four[1]);
        let width = |tile: usize| rounds[0][tile].tile.width;
        for tile in 1..x.len() {
            let (w, before) = (width(tile), width(tile - 1));
            let shared = x[tile].iter().enumerate().filter(|(i, _)| i % w < before);
            let pairs = shared.filter_map(|(i, &v)| Some((*x[tile - 1].get(i / w * before + i % w)?, v)));
            terms.extend(products(pairs.collect()));
        }
    }
    let z = z(&terms);
    assert!(
        z.abs() < LARGEST_Z,
        "tiles have the same noise: z = {z}; are random numbers numbered from the tile's corner?"
    );
}

/// Sum of the channels of a − b; 0 where that is rounding or not finite.
fn difference(a: &Batch, b: &Batch) -> Vec<f64> {
    let sum = |p: &[f32; 3]| p.iter().map(|&c| f64::from(c)).sum::<f64>();
    let size = |p: &[f32; 3]| p.iter().map(|&c| f64::from(c).abs()).sum::<f64>();
    let noise = |(a, b): (&[f32; 3], &[f32; 3])| {
        let d = sum(a) - sum(b);
        if d.is_finite() && d.abs() > ROUNDING * size(a).max(size(b)) { d } else { 0.0 }
    };
    a.mean.iter().zip(&b.mean).map(noise).collect()
}

/// Σt/√Σt²; 0 without noise.
fn z(terms: &[f64]) -> f64 {
    let (sum, squares) = terms.iter().fold((0.0, 0.0), |(sum, squares), t| (sum + t, squares + t * t));
    if squares > 0.0 { sum / f64::sqrt(squares) } else { 0.0 }
}

/// Checks that the oracle sees no noise in the reference of a source: held against the reference of another seed, each of its tiles
/// has converged (bundled model, P ≥ 0.9, tiles of 32×32 pixels). `make` makes sources of one scene, seeded as it is told. Noise
/// that does not depend on the seed is not found.
///
/// # Panics
/// If a tile has not converged, or there is no reference, or it is none that [`check_source`] takes.
pub fn check_reference_is_free_of_noise<S: ProgressiveSource>(make: impl Fn(u64) -> S) {
    let [one, other] = [1, 2].map(|seed| {
        let mut source = make(seed);
        let info = source.info();
        check_reference(&mut source, &info).expect("the source has no reference")
    });
    let (size, oracle) = ((one.width, one.height), Oracle::bundled());
    let display = ToneMapping::default().settle(&one.pixels);
    // Each counts as one sample of a pixel.
    let pair = [&one, &other].map(|r| Rendering { pixels: &r.pixels, spp: 1.0, rounding: 0.0 }).into();
    let tiles: Vec<Tile> = TileGrid::new(size.0, size.1, EDGE).expect("an image in range").tiles().collect();
    let described: Vec<_> = tiles
        .iter()
        .map(|&tile| {
            let planes = TilePlanes::from_pair(size, tile, &display, pair, Samples::Independent);
            oracle.describe(&planes.expect("samples"), 1.0).expect("any tile")
        })
        .collect();
    for (tile, verdict) in tiles.iter().zip(oracle.judge_described(&described)) {
        let (index, p) = (tile.index, verdict.probability);
        assert!(verdict.converged, "tile {index} of the reference has noise that the oracle sees: P = {p:?}");
    }
}

fn check_reference(source: &mut impl ProgressiveSource, info: &SourceInfo) -> Option<Reference> {
    let reference = source.reference().unwrap_or_else(|e| panic!("the reference failed: {e} ({e:?})"))?;
    let size = (reference.width, reference.height);
    assert_eq!(size, (info.width, info.height), "the reference has not the image's size");
    assert_eq!(reference.pixels.len(), info.width * info.height, "pixels of the reference");
    assert!(reference.pixels.iter().flatten().all(|c| c.is_finite()), "the reference is not finite");
    Some(reference)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As `scipy.stats.ttest_ind(a, b, equal_var=False)` has it: t = −2.00455, ν = 6.97447.
    #[test]
    fn welch_is_as_published() {
        let p = welch(&[1.0, 2.0, 4.0, 7.0], &[3.0, 5.0, 9.0, 9.5, 12.0]);
        assert!((p - 0.085_195_899_6).abs() < 1e-9, "{p}");
    }
}

/// The Rust blocks of README and guide, run as doctests.
#[cfg(doctest)]
mod documents {
    #[doc = include_str!("../../README.md")]
    struct Readme;
    #[doc = include_str!("../../docs/guide.md")]
    struct Guide;
}
