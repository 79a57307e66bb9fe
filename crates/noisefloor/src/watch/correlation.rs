//! Correlations of differences of batches, over all that was seen.

use super::said::{CERTAIN, FACTOR, Fault, NOTABLE, STRONG, Warning};
use super::shift::Shift;
use super::values::Ends;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};

/// Concordance of a − b with a + b less its neighbours from which a seems much noisier than b. Running means have
/// 0.23 or more in Cornell boxes of 64×64 pixels, independent batches less than 0.07.
const MUCH: f64 = 0.15;
/// Standard errors from which it is worth to wait: p < 5·10⁻⁵, and there is one look.
const DOUBTFUL: f64 = 4.5;
/// Excess of noise of later running means from which their counts may be behind: it is 1.5 by one pass of equal ones.
const AHEAD: f64 = 1.15;
/// Share by which signs agree more often than not from which batches seem to contain the ones before. Totals of equal
/// passes have 0.27, less where some pixels have no noise.
const AGREED: f64 = 0.1;
/// Standard errors that tell which of two faults it is, if it is one.
const LIKELY: f64 = 2.0;

/// The correlation of two differences x and y, each of mean 0: Σxy with what it is measured by.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(super) struct Correlation {
    terms: Mean,
    left: f64,
    right: f64,
}

impl Correlation {
    pub(super) fn of(pairs: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut all = Self::default();
        for (x, y) in pairs {
            all.terms.see(x * y);
            all.left += x * x;
            all.right += y * y;
        }
        all
    }

    pub(super) fn add(&mut self, more: &Self) {
        self.terms.add(&more.terms);
        self.left += more.left;
        self.right += more.right;
    }

    /// −1…1.
    fn value(&self) -> f64 {
        let size = (self.left * self.right).sqrt();
        if size > 0.0 { self.terms.sum / size } else { 0.0 }
    }
}

/// How often two differences x and y have the same sign: Σ sign(xy)·√|xy|. The root keeps a few outliers,
/// which most noise of renderers has, from hiding what all other pixels say.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(super) struct Concordance {
    terms: Mean,
    sizes: f64,
}

impl Concordance {
    /// Of one tile, as one term if its pixels share samples.
    pub(super) fn of(pairs: impl Iterator<Item = (f64, f64)>, as_one: bool) -> Self {
        Self::sized(pairs.map(|(x, y)| (x * y, (x * y).abs().sqrt())), as_one)
    }

    /// The same by signs alone, for differences that are distributed symmetrically: all that are not 0 count alike.
    pub(super) fn of_signs(pairs: impl Iterator<Item = (f64, f64)>, as_one: bool) -> Self {
        let sign = |(x, y): (f64, f64)| if x * y == 0.0 { 0.0 } else { x.signum() * y.signum() };
        Self::sized(pairs.map(sign).map(|sign| (sign, sign.abs())), as_one)
    }

    fn sized(products: impl Iterator<Item = (f64, f64)>, as_one: bool) -> Self {
        let mut all = Self::default();
        for (product, size) in products {
            all.terms.see(size.copysign(product));
            all.sizes += size;
        }
        if as_one {
            all.terms.squares = all.terms.sum * all.terms.sum;
        }
        all
    }

    pub(super) fn add(&mut self, more: &Self) {
        self.terms.add(&more.terms);
        self.sizes += more.sizes;
    }

    /// −1…1: 1 if all signs agree.
    fn value(&self) -> f64 {
        if self.sizes > 0.0 { self.terms.sum / self.sizes } else { 0.0 }
    }
}

/// Energies e and f that should be equal: Σ(e − f), with what it is measured by.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(super) struct Energies {
    one: f64,
    other: f64,
    squares: f64,
}

impl Energies {
    pub(super) fn see(&mut self, one: f64, other: f64) {
        self.one += one;
        self.other += other;
        self.squares += (one - other) * (one - other);
    }

    /// How many times the energy of the other the one has.
    fn ratio(&self) -> f64 {
        self.one / self.other
    }

    fn add(&mut self, more: &Self) {
        self.one += more.one;
        self.other += more.other;
        self.squares += more.squares;
    }

    /// How many times the energy of the one the other has, if that is neither chance nor little; with z
    /// divided by what pixels that are not independent widen it by.
    pub(super) fn excess(&self, widening: f64) -> Option<f64> {
        self.excess_of(FACTOR, widening)
    }

    /// The same from another factor on.
    fn excess_of(&self, least: f64, widening: f64) -> Option<f64> {
        let z = (self.other - self.one) / self.squares.sqrt() / widening;
        let factor = 1.0 / self.ratio();
        (z > CERTAIN && factor > least).then_some(factor)
    }
}

/// A sum of differences, with what it is measured by.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(super) struct Mean {
    sum: f64,
    squares: f64,
}

impl Mean {
    pub(super) fn see(&mut self, difference: f64) {
        self.sum += difference;
        self.squares += difference * difference;
    }

    fn add(&mut self, more: &Self) {
        self.sum += more.sum;
        self.squares += more.squares;
    }

    /// Standard errors from 0.
    fn z(&self) -> f64 {
        if self.squares > 0.0 { self.sum / self.squares.sqrt() } else { 0.0 }
    }
}

/// What was found in groups of batches.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(super) struct Sums {
    /// Of a − c and b − d.
    pub(super) batches: Concordance,
    /// The same without what all pixels of a tile have in common.
    pub(super) apart: Concordance,
    /// Of a − c and b − d, each less that of the pixel beside it, of batches with more and more samples.
    pub(super) totals: Concordance,
    /// Of a − b and a + b − 2c.
    pub(super) nested: Correlation,
    /// Of a − b and a + b less the same of its neighbours: is a noisier than b, by two batches alone?
    pub(super) early: Concordance,
    /// Σ(a − b)(a + b − neighbours) and Σ(a − b)² of the same.
    pub(super) early_energies: [f64; 2],
    /// Of a − b and the same one pixel beside.
    pub(super) neighbours: Correlation,
    /// Noise of the smaller two batches, and of the larger two, each times what their numbers of samples make
    /// of it.
    pub(super) counts: Energies,
    /// Squared differences of the first three running means, times what their numbers of samples make of the later one.
    pub(super) early_steps: Energies,
    /// Those differences themselves, likewise.
    pub(super) fading: [Mean; 2],
    /// (a − b)² and (c − d)² of equal batches: steps of a running mean become smaller.
    pub(super) steps: Energies,
    /// (Σ(a − b))² of four watched pixels in a row, and Σ(a − b)².
    pub(super) rows: [f64; 2],
    pub(super) ends: Ends,
    /// What larger batches are brighter by.
    pub(super) shift: Shift,
}

impl Sums {
    pub(super) fn add(&mut self, more: &Self) {
        self.batches.add(&more.batches);
        self.apart.add(&more.apart);
        self.totals.add(&more.totals);
        self.nested.add(&more.nested);
        self.early.add(&more.early);
        self.early_energies.iter_mut().zip(more.early_energies).for_each(|(sum, more)| *sum += more);
        self.neighbours.add(&more.neighbours);
        self.counts.add(&more.counts);
        self.steps.add(&more.steps);
        self.early_steps.add(&more.early_steps);
        self.fading.iter_mut().zip(&more.fading).for_each(|(sum, more)| sum.add(more));
        self.rows.iter_mut().zip(more.rows).for_each(|(sum, more)| *sum += more);
        self.ends.add(more.ends);
        self.shift.add(&more.shift);
    }

    /// What of it counts where samples complete each other. Their noise need not fall with their number, and depends on
    /// where in its sequence a batch lies; batches of one sequence are not independent. Of a large batch, which has less noise
    /// than many small ones, a mean of both knows less, and so weights by it make the large one brighter ([`Shift`]).
    pub(super) fn of_points(self, one_sequence: bool) -> Self {
        let Self { neighbours, rows, ends, batches, apart, totals, early, early_energies, .. } = self;
        let pixels = Self { neighbours, rows, ends, ..Self::default() };
        if one_sequence { pixels } else { Self { batches, apart, totals, early, early_energies, ..pixels } }
    }

    /// By how much watched pixels that are not independent widen z: at least 1.
    fn widening(&self) -> f64 {
        let [sums, all] = self.rows;
        if all > 0.0 { (sums / all).max(1.0).sqrt() } else { 1.0 }
    }

    /// Standard errors from 0, with care.
    fn z(&self, of: &Concordance) -> f64 {
        of.terms.z() / self.widening()
    }

    /// The correlation of batches and its z: the smaller ones of all noise and of that which pixels have for
    /// themselves, since a few noisy pixels decide what is in common.
    fn of_batches(&self) -> (f64, f64) {
        let smaller = |x: f64, y: f64| if x * y > 0.0 { x.abs().min(y.abs()).copysign(x) } else { 0.0 };
        let value = smaller(self.batches.value(), self.apart.value());
        (smaller(self.z(&self.batches), self.z(&self.apart)), value)
    }

    /// How many times the noise energy of b a seems to have, if that is much and four batches do not say that
    /// it is no matter: they are not correlated if a is merely noisier. In small pictures one group is too
    /// little to be sure of running means. It is 99 if b is a running mean, which has (a − b)(a + b) = (a −
    /// b)² on average.
    pub(super) fn doubt(&self) -> Option<f64> {
        let open = self.batches.sizes == 0.0 || self.of_batches().1 > STRONG / 2.0;
        let [falls, all] = self.early_energies;
        let share = (falls / all).clamp(0.2, 0.98);
        (open && self.is_falling(DOUBTFUL)).then_some((1.0 + share) / (1.0 - share))
    }

    /// Whether a is noisier than b, by much and by so many standard errors. The energies themselves are up to a few
    /// pixels.
    fn is_falling(&self, by: f64) -> bool {
        self.early.value() > MUCH && self.z(&self.early) > by
    }

    /// The correlation of batches that are said to have more and more samples, if they seem to contain the ones before.
    pub(super) fn may_be_totals(&self) -> Option<f64> {
        let correlation = self.totals.value();
        (self.z(&self.totals) > DOUBTFUL && correlation > AGREED).then_some(correlation)
    }

    pub(super) fn fault(&self) -> Result<(), Fault> {
        if let Some(correlation) = self.may_be_totals().filter(|_| self.z(&self.totals) > CERTAIN) {
            return Err(Fault::Running { correlation });
        }
        let (z, correlation) = self.of_batches();
        if z < CERTAIN || correlation < STRONG {
            return Ok(());
        }
        // Where the light of a scene changes, steps differ, but a is as noisy as b
        let smaller_steps =
            self.steps.ratio() > FACTOR && (self.early.sizes == 0.0 || self.early.value() > 0.0);
        Err(if smaller_steps || self.is_falling(LIKELY) {
            Fault::Running { correlation }
        } else {
            Fault::Shared { correlation }
        })
    }

    pub(super) fn warnings(&self, shared: bool) -> impl Iterator<Item = Warning> {
        let mut warnings = Vec::new();
        let (z, value) = self.of_batches();
        if z > CERTAIN && value < STRONG {
            warnings.push(Warning::Shared(value));
        }
        if z < -CERTAIN && value < -NOTABLE {
            warnings.push(Warning::Anticorrelated(value));
        }
        let whole = self.batches.value();
        let encoded = self.encoded();
        if !shared && self.z(&self.batches) > CERTAIN && whole > STRONG && z < CERTAIN && encoded.is_none() {
            warnings.push(Warning::Changing(whole));
        }
        // With k times the energy in a, and as much in c as in b, it is (k − 1)/√((k + 1)(k + 5))
        let r = self.nested.value();
        let noise = (1.0 + 3.0 * r * r + r * (12.0 + 4.0 * r * r).sqrt()) / (1.0 - r * r);
        let noisier = !shared
            && self.nested.terms.z().abs() / self.widening() > CERTAIN
            && !(1.0 / FACTOR..FACTOR).contains(&noise);
        if noisier {
            warnings.push(Warning::Noise(noise.max(0.0)));
        }
        let (z, beside) = (self.neighbours.terms.z(), self.neighbours.value());
        if !shared && z.abs() > CERTAIN && beside.abs() > NOTABLE {
            warnings.push(Warning::Neighbours(beside));
        }
        // More noise than the number says, if equal numbers have equal noise. Points of a quasi-random
        // sequence have less
        if !noisier {
            warnings.extend(self.counts.excess(self.widening()).map(Warning::Counts));
        }
        warnings.extend(encoded.map(Warning::Encoded));
        warnings.into_iter()
    }

    /// What larger batches are brighter by, in per cent, if they are.
    pub(super) fn encoded(&self) -> Option<f64> {
        self.shift.brighter(self.widening())
    }

    /// How many times the noise, or the brightness, that their counts say later running means have beside the first, if
    /// they seem to have more samples than they are said to have.
    pub(super) fn behind(&self) -> Option<f64> {
        if let Some(times) = self.early_steps.excess_of(AHEAD, self.widening()) {
            return Some(times);
        }
        let [early, late] = self.fading;
        let alike = (0.5..2.0).contains(&(early.sum / late.sum));
        let fades = early.z() / self.widening() > CERTAIN && late.z() / self.widening() > LIKELY && alike;
        fades.then_some(early.sum / late.sum)
    }
}
