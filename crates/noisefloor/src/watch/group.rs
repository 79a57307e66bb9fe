//! Four successive batches of a tile against each other.

use super::correlation::{Concordance, Correlation, Sums};
use super::points::level;
use super::repeats::{ROUNDING, Repeats};
use super::values::{Ends, Values};
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};

/// Sizes of batches that may differ by this factor at most to be compared.
const ALIKE: u64 = 2;
/// Factor by which the sizes of two pairs of batches may differ whose noise is compared. If few fireflies
/// make all noise, the larger pair has k times as many of them, and the smaller one by chance none: that is z
/// = √N if the other has N, and p = exp(−N/k). At z = 6.5 that is 7·10⁻⁷ for k = 3.
const NEAR: f64 = 3.0;
/// Samples a pixel from which a value of exactly 1 is no sample of a light.
const MANY: u64 = 8;

/// A batch at the watched pixels: the luminance of each, between that of its neighbours.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
struct WatchedBatch {
    spp: u64,
    light: Vec<[f32; 3]>,
}

/// What is kept of one tile.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(super) struct TileWatch {
    /// Batches so far.
    pub(super) batches: u64,
    pub(super) repeats: Repeats,
    /// Whether each of the first batches was said to have more samples than the one before.
    pub(super) grows: bool,
    /// What was found since the last check.
    pub(super) sums: Sums,
    /// What the values of the first group have in common.
    pub(super) values: Values,
    group: Vec<WatchedBatch>,
}

impl TileWatch {
    /// Whether what was read can be what was written of a tile, which has so many watched pixels at first and
    /// later.
    #[cfg(feature = "files")]
    pub(super) fn fits(&self, at_first: usize, later: usize) -> bool {
        let points = if self.batches <= 4 { at_first } else { later };
        self.group.len() < 4 && self.group.iter().all(|seen| seen.spp > 0 && seen.light.len() == points)
    }

    pub(super) fn see(&mut self, spp: u64, light: Vec<[f32; 3]>) {
        if let Some(last) = self.group.last() {
            self.grows = spp > last.spp && (self.group.len() == 1 || self.grows);
        }
        self.group.push(WatchedBatch { spp, light });
    }

    /// What the last batch says together with those before in its group.
    pub(super) fn compare(&mut self, shared: bool) -> Option<Sums> {
        let mut found = match &self.group[..] {
            [a, b] => pair(a, b, shared),
            [_, _, c, d] => pair(c, d, shared),
            _ => return None,
        };
        if let [a, b, c, d] = &self.group[..] {
            four([a, b, c, d], shared, &mut found);
            if self.batches == 4 {
                totals([a, b, c], &mut found);
            }
            self.group.clear();
        }
        Some(found)
    }
}

/// What differences at each watched pixel are multiplied by, 1/(t + m): m is the mean of these batches there,
/// and t that of a typical pixel. It is how much v/(t + v), as screens show light, changes with v, but for a
/// factor. Without it, the dozen pixels at the edge of a lamp outweigh the picture.
///
/// All samples count alike in m. Which of them lie in which batch is chance if they are independent, whatever
/// m is, so that differences have the mean 0 with their weights as well.
fn weights(batches: &[&WatchedBatch], place: usize) -> Vec<f64> {
    let all: f64 = batches.iter().map(|seen| seen.spp as f64).sum();
    let mean = |i: usize| -> f64 {
        batches.iter().map(|seen| f64::from(seen.light[i][place]) * (seen.spp as f64 / all)).sum()
    };
    let means: Vec<f64> = (0..batches[0].light.len()).map(|i| mean(i).abs()).collect();
    let typical = level(&means);
    means.into_iter().map(|mean| finite(1.0 / (typical + mean))).collect()
}

/// Two batches, one for each half.
fn pair(a: &WatchedBatch, b: &WatchedBatch, shared: bool) -> Sums {
    let mut sums = Sums::default();
    if a.spp != b.spp {
        return sums;
    }
    let difference = |place: usize| -> Vec<f64> {
        let batches = a.light.iter().zip(&b.light).zip(weights(&[a, b], place));
        batches.map(|((a, b), w)| finite((f64::from(a[place]) - f64::from(b[place])) * w)).collect()
    };
    let (here, left) = (difference(1), difference(0));
    sums.neighbours = Correlation::of(here.iter().copied().zip(left));
    add_rows(&here, &mut sums.rows);
    if !shared {
        let falls = a.light.iter().zip(&b.light).zip(weights(&[a, b], 1)).map(|((a, b), w)| {
            let [left, here, right] = std::array::from_fn(|place| f64::from(a[place]) + f64::from(b[place]));
            finite((here - (left + right) / 2.0) * w)
        });
        let pairs: Vec<(f64, f64)> = here.into_iter().zip(falls).collect();
        sums.early_energies =
            [pairs.iter().map(|(x, y)| x * y).sum(), pairs.iter().map(|(x, _)| x * x).sum()];
        // Where the neighbours differ by much more than noise, it is the picture that says which is larger
        let level = |(x, y): (f64, f64)| (x, y * (x / y).powi(2).min(1.0));
        sums.early = Concordance::of(pairs.into_iter().map(level).filter(|pair| pair.1.is_finite()), false);
    }
    if a.spp >= MANY {
        sums.ends = a.light.iter().zip(&b.light).map(|(a, b)| Ends::of(a[1], b[1])).sum();
    }
    sums
}

/// A whole group.
fn four([a, b, c, d]: [&WatchedBatch; 4], shared: bool, sums: &mut Sums) {
    let weights = weights(&[a, b, c, d], 1);
    let combined = |of: [f64; 4]| -> Vec<f64> {
        let at = |i: usize| -> f64 {
            [a, b, c, d].iter().zip(of).map(|(seen, of)| f64::from(seen.light[i][1]) * of).sum()
        };
        weights.iter().enumerate().map(|(i, w)| finite(at(i) * w)).collect()
    };
    let alike = |one: &WatchedBatch, other: &WatchedBatch| {
        one.spp <= other.spp.saturating_mul(ALIKE) && other.spp <= one.spp.saturating_mul(ALIKE)
    };
    let pairs = |x: Vec<f64>, y: Vec<f64>| x.into_iter().zip(y);
    let (ab, cd) = (combined([1.0, -1.0, 0.0, 0.0]), combined([0.0, 0.0, 1.0, -1.0]));
    if alike(a, c) && alike(b, d) {
        let (ac, bd) = (combined([1.0, 0.0, -1.0, 0.0]), combined([0.0, 1.0, 0.0, -1.0]));
        let picture = combined([1.0; 4]);
        let apart = pairs(without_gain(&ac, &picture), without_gain(&bd, &picture));
        sums.apart = Concordance::of(apart, shared);
        sums.batches = Concordance::of(pairs(ac, bd), shared);
    }
    if a.spp < b.spp && b.spp < c.spp && c.spp < d.spp {
        // Noise of unlike numbers of samples is skewed unlike. That of two pixels that are alike is not, so that signs are
        // enough, which no firefly outweighs
        let beside = |one: &WatchedBatch, other: &WatchedBatch, i: usize| {
            let [_, here, right] =
                std::array::from_fn(|place| f64::from(one.light[i][place] - other.light[i][place]));
            let noise = here - right;
            let size: f32 =
                [one, other].iter().map(|seen| seen.light[i][1].abs() + seen.light[i][2].abs()).sum();
            if noise.abs() > f64::from(ROUNDING * size) { finite(noise * weights[i]) } else { 0.0 }
        };
        let (ac, bd): (Vec<f64>, Vec<f64>) =
            (0..weights.len()).map(|i| (beside(a, c, i), beside(b, d, i))).unzip();
        add_rows(&ac, &mut sums.rows);
        sums.totals = Concordance::of_signs(pairs(ac, bd), shared);
    }
    if a.spp == b.spp && alike(b, c) {
        sums.nested = Correlation::of(ab.iter().copied().zip(combined([1.0, 1.0, -2.0, 0.0])));
    }
    // Noise of n samples against that of m has 1/n + 1/m of the energy that one sample has
    let size =
        |one: &WatchedBatch, other: &WatchedBatch| 1.0 / (1.0 / one.spp as f64 + 1.0 / other.spp as f64);
    let (first, last) = (size(a, b), size(c, d));
    let energies = ab.iter().map(|ab| ab * ab).zip(cd.iter().map(|cd| cd * cd));
    if first == last && a.spp == b.spp {
        energies.for_each(|(ab, cd)| sums.steps.see(ab, cd));
    } else if first < last && last <= NEAR * first {
        energies.for_each(|(ab, cd)| sums.counts.see(first * ab, last * cd));
    } else if last < first && first <= NEAR * last {
        energies.for_each(|(ab, cd)| sums.counts.see(last * cd, first * ab));
    }
}

/// The first running means of a picture, against each other: of batches a, b, c, those of a, of a and b, and of all.
///
/// If they are what their numbers of samples n, m, l say, they differ by σ²(1/n − 1/m) and σ²(1/m − 1/l). If each has k
/// samples more, which the count does not know yet, by less in the beginning; and if a sum was divided by that count,
/// they are brighter by k/n, k/m and k/l.
fn totals([a, b, c]: [&WatchedBatch; 3], sums: &mut Sums) {
    let weights = weights(&[a, b, c], 1);
    let [first, second, third] = [a.spp as f64, b.spp as f64, c.spp as f64];
    let (n, m, l) = (first, first + second, first + second + third);
    let times = (1.0 / n - 1.0 / m) / (1.0 / m - 1.0 / l);
    for (i, weight) in weights.into_iter().enumerate() {
        let [a, b, c] = [a, b, c].map(|batch| f64::from(batch.light[i][1]));
        let (two, three) = ((first * a + second * b) / m, (first * a + second * b + third * c) / l);
        let (early, late) = (finite((a - two) * weight), finite((two - three) * weight));
        sums.early_steps.see(early * early, times * late * late);
        sums.fading[0].see(early);
        sums.fading[1].see(times * late);
    }
}

/// Differences in rows of four watched pixels, for [`Sums::rows`].
fn add_rows(differences: &[f64], rows: &mut [f64; 2]) {
    for row in differences.chunks(4) {
        rows[0] += row.iter().sum::<f64>().powi(2);
        rows[1] += energy(row);
    }
}

fn energy(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

/// Differences less what they have in common with the picture, which varies for all pixels as one where a
/// renderer estimates the brightness of all.
fn without_gain(differences: &[f64], picture: &[f64]) -> Vec<f64> {
    let common: f64 = differences.iter().zip(picture).map(|(x, picture)| x * picture).sum();
    let gain = common / energy(picture).max(f64::MIN_POSITIVE);
    differences.iter().zip(picture).map(|(x, picture)| x - gain * picture).collect()
}

/// Nothing in place of what is not finite.
fn finite(x: f64) -> f64 {
    if x.is_finite() { x } else { 0.0 }
}

#[cfg(test)]
impl TileWatch {
    /// A batch without watched pixels.
    pub(super) fn corrupt(&mut self) {
        self.group.push(WatchedBatch { spp: 1, light: Vec::new() });
    }
}
