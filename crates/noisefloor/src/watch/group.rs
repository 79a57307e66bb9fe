//! Four successive batches of a tile against each other.

use super::correlation::{Correlation, Sums};
use super::values::Ends;

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

    /// What the last batch says together with those before in its group.
    pub(super) fn compare(&mut self, shared: bool) -> Option<Sums> {
        let mut found = match &self.group[..] {
            [a, b] => pair(a, b),
            [_, _, c, d] => pair(c, d),
            _ => return None,
        };
        if let [a, b, c, d] = &self.group[..] {
            four([a, b, c, d], shared, &mut found);
            self.group.clear();
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
    let same =
        |(a, b): (&f32, &f32)| a.to_bits() == b.to_bits() || (a - b).abs() <= ROUNDING * a.abs().max(b.abs());
    one.as_flattened().iter().zip(other.as_flattened()).all(same)
}

/// Two batches, one for each half.
fn pair(a: &Seen, b: &Seen) -> Sums {
    let mut sums = Sums::default();
    if a.spp != b.spp {
        return sums;
    }
    let difference = |place: usize| {
        let values = a.light.iter().zip(&b.light);
        let both = |(a, b): (&[f32; 3], &[f32; 3])| {
            finite((f64::from(a[place] - b[place]), f64::from(a[place] + b[place])))
        };
        without_gain(&values.map(both).collect::<Vec<_>>())
    };
    let (here, beside) = (difference(1), difference(0));
    sums.neighbours = Correlation::of(here.iter().copied().zip(beside), false);
    for row in here.chunks(4) {
        sums.rows[0] += row.iter().sum::<f64>().powi(2);
        sums.rows[1] += row.iter().map(|x| x * x).sum::<f64>();
    }
    if a.spp >= MANY {
        sums.ends = a.light.iter().zip(&b.light).map(|(a, b)| Ends::of(a[1], b[1])).sum();
    }
    sums
}

/// A whole group.
fn four([a, b, c, d]: [&Seen; 4], shared: bool, sums: &mut Sums) {
    let with_gain = |of: [f64; 4]| -> Vec<(f64, f64)> {
        let values = a.light.iter().zip(&b.light).zip(c.light.iter().zip(&d.light));
        let combined = |((a, b), (c, d)): ((&[f32; 3], &[f32; 3]), (&[f32; 3], &[f32; 3]))| {
            let four = [a[1], b[1], c[1], d[1]].map(f64::from);
            finite((four.iter().zip(of).map(|(v, of)| v * of).sum(), four.iter().sum()))
        };
        values.map(combined).collect()
    };
    let combined = |of| without_gain(&with_gain(of));
    let alike = |one: &Seen, other: &Seen| {
        one.spp <= other.spp.saturating_mul(ALIKE) && other.spp <= one.spp.saturating_mul(ALIKE)
    };
    if alike(a, c) && alike(b, d) {
        let (ac, bd) = (with_gain([1.0, 0.0, -1.0, 0.0]), with_gain([0.0, 1.0, 0.0, -1.0]));
        let pairs = without_gain(&ac).into_iter().zip(without_gain(&bd));
        sums.batches = Correlation::of(pairs, shared);
        sums.whole = Correlation::of(ac.iter().zip(&bd).map(|(x, y)| (x.0, y.0)), shared);
    }
    if a.spp != b.spp {
        return;
    }
    let ab = combined([1.0, -1.0, 0.0, 0.0]);
    if alike(b, c) {
        let pairs = ab.iter().copied().zip(combined([1.0, 1.0, -2.0, 0.0]));
        sums.nested = Correlation::of(pairs, shared);
    }
    if c.spp == d.spp && alike(a, c) {
        let energy = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
        let cd = combined([0.0, 0.0, 1.0, -1.0]);
        for (ab, cd) in ab.chunks(BLOCK).zip(cd.chunks(BLOCK)) {
            let (ab, cd) = (energy(ab), energy(cd));
            let energies = if a.spp == c.spp { &mut sums.steps } else { &mut sums.counts };
            energies.see(a.spp as f64 * ab, c.spp as f64 * cd);
        }
    }
}

/// Differences less what they have in common with the picture, which varies for all pixels as one where a
/// renderer estimates the brightness of all.
fn without_gain(values: &[(f64, f64)]) -> Vec<f64> {
    let (mut common, mut size) = (0.0, 0.0);
    for (x, picture) in values {
        common += x * picture;
        size += picture * picture;
    }
    let gain = if size > 0.0 { common / size } else { 0.0 };
    values.iter().map(|(x, picture)| x - gain * picture).collect()
}

/// A difference beside the picture; nothing where one of them is not finite.
fn finite((x, picture): (f64, f64)) -> (f64, f64) {
    if x.is_finite() && picture.is_finite() { (x, picture) } else { (0.0, 0.0) }
}
