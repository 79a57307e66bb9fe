//! Four successive batches of a tile against each other.

use super::correlation::{Concordance, Correlation, Sums};
use super::values::Ends;
use crate::rgb::Rgb;

/// Values that differ by less, relative to their size, are the same but for rounding.
const ROUNDING: f32 = 1.0 / (1 << 18) as f32;
/// Second differences below this, relative to the pixels, are no noise.
const ROUGH: f32 = 1e-3;
/// Fewest rough pixels of a tile that has noise.
const LEAST_ROUGH: usize = 4;
/// Sizes of batches that may differ by this factor at most to be compared.
const ALIKE: u64 = 2;
/// Watched pixels whose energies are one term.
const BLOCK: usize = 16;
/// Samples a pixel from which a value of exactly 1 is no sample of a light.
const MANY: u64 = 8;

/// A batch at the watched pixels: the luminance of each, between that of its neighbours.
#[derive(Clone, Debug)]
struct Seen {
    spp: u64,
    light: Vec<[f32; 3]>,
}

/// What is kept of one tile.
#[derive(Clone, Debug, Default)]
pub(super) struct TileWatch {
    /// Batches so far.
    pub(super) batches: u64,
    /// Whether two batches came, the last of which looked noisy.
    pub(super) noisy: bool,
    /// Whether a noisy batch came twice.
    pub(super) repeated: bool,
    /// Whether values by themselves differ from batch to batch by more than rounding: they have noise.
    pub(super) varies: bool,
    /// Those of the first batch, while the first group lasts.
    first: Vec<Rgb>,
    group: Vec<Seen>,
}

impl TileWatch {
    pub(super) fn see(&mut self, spp: u64, light: Vec<[f32; 3]>) {
        if !self.group.is_empty() && is_rough(&light) {
            self.noisy = true;
            self.repeated |= self.group.iter().any(|seen| is_same(&seen.light, &light));
        }
        self.group.push(Seen { spp, light });
    }

    /// Takes notice of the values of a batch of the first group.
    pub(super) fn see_values(&mut self, values: Vec<Rgb>) {
        if self.first.is_empty() {
            self.first = values;
        } else {
            let pairs = self.first.as_flattened().iter().zip(values.as_flattened());
            self.varies |= pairs.into_iter().any(|pair| !is_same_value(pair));
        }
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
            self.group.clear();
            self.first = Vec::new();
        }
        Some(found)
    }
}

/// Whether most lit pixels differ from the line between their neighbours.
fn is_rough(light: &[[f32; 3]]) -> bool {
    let (mut lit, mut rough) = (0, 0);
    for [left, here, right] in light {
        let size = left.abs() + 2.0 * here.abs() + right.abs();
        lit += usize::from(size > 0.0);
        rough += usize::from((left - 2.0 * here + right).abs() > ROUGH * size);
    }
    rough >= LEAST_ROUGH && 2 * rough > lit
}

fn is_same(one: &[[f32; 3]], other: &[[f32; 3]]) -> bool {
    one.as_flattened().iter().zip(other.as_flattened()).all(is_same_value)
}

fn is_same_value((a, b): (&f32, &f32)) -> bool {
    a.to_bits() == b.to_bits() || (a - b).abs() <= ROUNDING * a.abs().max(b.abs())
}

/// Two batches, one for each half.
fn pair(a: &Seen, b: &Seen, shared: bool) -> Sums {
    let mut sums = Sums::default();
    if a.spp != b.spp {
        return sums;
    }
    let difference = |place: usize| {
        a.light.iter().zip(&b.light).map(move |(a, b)| finite(f64::from(a[place]) - f64::from(b[place])))
    };
    sums.neighbours = Correlation::of(difference(1).zip(difference(0)));
    for row in difference(1).collect::<Vec<_>>().chunks(4) {
        sums.rows[0] += row.iter().sum::<f64>().powi(2);
        sums.rows[1] += energy(row);
    }
    if !shared {
        let falls = a.light.iter().zip(&b.light).map(|(a, b)| {
            let [left, here, right] = std::array::from_fn(|place| f64::from(a[place]) + f64::from(b[place]));
            finite(here - (left + right) / 2.0)
        });
        let pairs: Vec<(f64, f64)> = difference(1).zip(falls).collect();
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
fn four([a, b, c, d]: [&Seen; 4], shared: bool, sums: &mut Sums) {
    let combined = |of: [f64; 4]| -> Vec<f64> {
        let at =
            |i: usize| [a, b, c, d].iter().zip(of).map(|(seen, of)| f64::from(seen.light[i][1]) * of).sum();
        (0..a.light.len()).map(|i| finite(at(i))).collect()
    };
    let alike = |one: &Seen, other: &Seen| {
        one.spp <= other.spp.saturating_mul(ALIKE) && other.spp <= one.spp.saturating_mul(ALIKE)
    };
    let pairs = |x: Vec<f64>, y: Vec<f64>| x.into_iter().zip(y);
    if alike(a, c) && alike(b, d) {
        let (ac, bd) = (combined([1.0, 0.0, -1.0, 0.0]), combined([0.0, 1.0, 0.0, -1.0]));
        let picture = combined([1.0; 4]);
        let apart = pairs(without_gain(&ac, &picture), without_gain(&bd, &picture));
        sums.apart = Concordance::of(apart, shared);
        sums.batches = Concordance::of(pairs(ac, bd), shared);
    }
    if a.spp != b.spp {
        return;
    }
    let ab = combined([1.0, -1.0, 0.0, 0.0]);
    if alike(b, c) {
        sums.nested = Correlation::of(ab.iter().copied().zip(combined([1.0, 1.0, -2.0, 0.0])));
    }
    if c.spp == d.spp && alike(a, c) {
        let energies = if a.spp == c.spp { &mut sums.steps } else { &mut sums.counts };
        for (ab, cd) in ab.chunks(BLOCK).zip(combined([0.0, 0.0, 1.0, -1.0]).chunks(BLOCK)) {
            energies.see(a.spp as f64 * energy(ab), c.spp as f64 * energy(cd));
        }
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
