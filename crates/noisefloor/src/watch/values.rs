//! The values of the first batches by themselves.

use super::said::{Encoding, Precision, Warning};
use crate::display::{luminance, srgb_encode};
use crate::rgb::Rgb;
use rayon::prelude::*;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use std::iter::Sum;

/// Watched values without which nothing is said about values.
const LEAST_VALUES: u64 = 64;

/// Distance from a whole number of 255ths that is rounding.
const NEAR: f32 = 4e-3;
/// Different numbers of 8 bits, besides 0 and 255, without which it is not said that values are such.
const LEAST_LEVELS: u32 = 8;

/// What the watched values of the first batches have in common.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(super) struct Values {
    seen: u64,
    /// How many are 8-bit numbers, and which: divided by 255, sRGB-decoded, whole.
    levels: [Levels; 3],
    /// How many are integers of more bits, as [`STEPS`] has them.
    finer: [Steps; STEPS.len()],
    digits: Digits,
    first: Option<Rgb>,
    varied: bool,
    pub(super) above_one: bool,
}

/// Integers of more than 8 bits that pictures are stored in: what 1 is, the bits, whether they are sRGB-encoded, and
/// how far from a whole number rounding leads. 24 bits of a float leave 16 of an integer uncertain by 0.004, and
/// what `srgb_encode` errs by is 0.07 of their steps; of 64 other values, all lie as near with p < 10⁻³³.
const STEPS: [(f32, u32, bool, f32); 5] = [
    (1023.0, 10, false, NEAR),
    (1023.0, 10, true, NEAR),
    (65_535.0, 16, false, 0.02),
    (65_535.0, 16, true, 0.15),
    (1.0, 16, false, 0.0),
];

/// The greatest common divisor; of 0 and a number, the number.
fn divisor(mut a: u32, mut b: u32) -> u32 {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// Values that are whole numbers of steps.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
struct Steps {
    count: u64,
    /// What all of them are multiples of: more than 1 if they are sums of a few samples that are 0 or 1.
    multiples: u32,
    /// Which numbers, modulo 61, besides 0 and the largest.
    which: u64,
}

/// Binary digits of the significands of values that are not 0.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
struct Digits {
    /// The most that one has, and how many values have so many, in each of four binades (by the exponent modulo 4).
    most: u32,
    with_most: [u32; 4],
    all: [u32; 4],
}

/// Digits from which values are those of 32-bit floats: half floats have 11, and small floats of 10 and 11 bits, and
/// brain floats, fewer.
const FEW_DIGITS: u32 = 12;
/// Values of a binade without which it says nothing.
const LEAST_IN_BINADE: u32 = 16;

impl Digits {
    fn see(&mut self, value: f32) {
        if self.most > FEW_DIGITS || value == 0.0 || !value.is_finite() {
            return;
        }
        let bits = value.to_bits();
        let digits = 24 - (bits & 0x007f_ffff | 0x0080_0000).trailing_zeros();
        let binade = (bits >> 23) as usize % 4;
        self.all[binade] += 1;
        self.take(digits);
        self.with_most[binade] += u32::from(digits == self.most);
    }

    /// There are values of so many digits.
    fn take(&mut self, digits: u32) {
        if digits > self.most {
            (self.most, self.with_most) = (digits, [0; 4]);
        }
    }

    fn add(&mut self, more: &Self) {
        self.take(more.most);
        for binade in 0..4 {
            self.all[binade] += more.all[binade];
            if more.most == self.most {
                self.with_most[binade] += more.with_most[binade];
            }
        }
    }

    /// The bits of the significand that all values were rounded to. Sums of n samples that are 0 or 1, over n, have
    /// few digits as well, but the same last place in each binade, and so the last digit in the uppermost alone.
    fn rounded(&self) -> Option<u32> {
        let is_used = |&(with_most, all): &(u32, u32)| all >= LEAST_IN_BINADE && 4 * with_most > all;
        let used = self.with_most.into_iter().zip(self.all).filter(is_used).count();
        (self.most <= FEW_DIGITS && used >= 2).then_some(self.most)
    }
}

#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
struct Levels {
    count: u64,
    /// As of [`Steps`].
    multiples: u32,
    which: [u64; 4],
}

impl Levels {
    fn see(&mut self, level: f32) {
        let near = level.round();
        if (level - near).abs() <= NEAR && (0.0..=255.0).contains(&near) {
            self.count += 1;
            let number = near as usize;
            self.multiples = divisor(self.multiples, number as u32);
            self.which[number / 64] |= 1 << (number % 64);
        }
    }

    fn are_all(&self, of: u64) -> bool {
        let [low, .., high] = self.which;
        let ends = (low & 1).count_ones() + (high >> 63) as u32;
        let levels: u32 = self.which.iter().map(|word| word.count_ones()).sum();
        self.count == of && levels - ends >= LEAST_LEVELS && self.multiples == 1
    }
}

impl Steps {
    fn see(&mut self, level: f32, bits: u32, near: f32) {
        let (whole, most) = (level.round(), (1u32 << bits) - 1);
        if (level - whole).abs() <= near && (0.0..=most as f32).contains(&whole) {
            self.count += 1;
            let number = whole as u32;
            self.multiples = divisor(self.multiples, number);
            if number != 0 && number != most {
                self.which |= 1 << (number % 61);
            }
        }
    }
}

impl Values {
    pub(super) fn see(&mut self, pixel: Rgb) {
        let first = *self.first.get_or_insert(pixel);
        self.varied |= first.map(f32::to_bits) != pixel.map(f32::to_bits);
        for value in pixel {
            self.seen += 1;
            self.above_one |= value > 1.0;
            // Once a value is none, no others need be looked at
            if self.levels[0].count + 1 == self.seen {
                self.levels[0].see(255.0 * value);
            }
            if self.levels[1].count + 1 == self.seen && (0.0..=1.0).contains(&value) {
                self.levels[1].see(255.0 * srgb_encode(value));
            }
            if self.levels[2].count + 1 == self.seen {
                self.levels[2].see(value);
            }
            for (steps, (white, bits, encoded, near)) in self.finer.iter_mut().zip(STEPS) {
                if steps.count + 1 == self.seen && (!encoded || (0.0..=1.0).contains(&value)) {
                    let level = white * if encoded { srgb_encode(value) } else { value };
                    steps.see(level, bits, near);
                }
            }
            self.digits.see(value);
        }
    }

    /// Takes together what was seen of other tiles.
    pub(super) fn add(&mut self, more: &Self) {
        self.seen += more.seen;
        for (levels, more) in self.levels.iter_mut().zip(more.levels) {
            levels.count += more.count;
            levels.multiples = divisor(levels.multiples, more.multiples);
            levels.which.iter_mut().zip(more.which).for_each(|(which, more)| *which |= more);
        }
        for (steps, more) in self.finer.iter_mut().zip(&more.finer) {
            (steps.count, steps.which) = (steps.count + more.count, steps.which | more.which);
            steps.multiples = divisor(steps.multiples, more.multiples);
        }
        self.digits.add(&more.digits);
        let differs = |(one, other): (Rgb, Rgb)| one.map(f32::to_bits) != other.map(f32::to_bits);
        self.varied |= more.varied || self.first.zip(more.first).is_some_and(differs);
        self.first = self.first.or(more.first);
        self.above_one |= more.above_one;
    }

    /// How all values are 8-bit numbers, if they are.
    pub(super) fn quantised(&self) -> Option<Encoding> {
        if self.seen < LEAST_VALUES {
            return None;
        }
        let [linear, srgb, whole] = self.levels.map(|levels| levels.are_all(self.seen));
        if linear || whole { Some(Encoding::Linear) } else { srgb.then_some(Encoding::Srgb) }
    }

    /// What coarser numbers all values are, if they are: of more than 8 bits.
    pub(super) fn precision(&self) -> Option<Precision> {
        if self.seen < LEAST_VALUES {
            return None;
        }
        let are_all = |steps: &&(Steps, (f32, u32, bool, f32))| {
            let Steps { count, multiples, which } = steps.0;
            count == self.seen && multiples == 1 && which.count_ones() >= LEAST_LEVELS
        };
        let found = self.finer.into_iter().zip(STEPS).collect::<Vec<_>>();
        let integers = found
            .iter()
            .find(are_all)
            .map(|&(_, (white, bits, ..))| Precision::Integers { bits, whole: white == 1.0 });
        integers.or_else(|| self.digits.rounded().map(|bits| Precision::Floats { bits }))
    }

    pub(super) fn constant(&self) -> Option<Warning> {
        let said = self.seen >= LEAST_VALUES && !self.varied;
        self.first.filter(|_| said).map(Warning::Constant)
    }
}

/// Noisy pixels, and those of them of which one batch of two is exactly 1.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(super) struct Ends {
    pub(super) noisy: u64,
    pub(super) at_white: u64,
}

impl Ends {
    pub(super) fn of(a: f32, b: f32) -> Self {
        let noisy = u64::from(a.to_bits() != b.to_bits());
        Self { noisy, at_white: noisy * u64::from(is_white(a.max(b))) }
    }

    /// The share of noisy pixels whose noise ends at 1, in per cent, where nothing is above 1.
    pub(super) fn clipped(self, values: &Values) -> Option<f64> {
        let share = self.at_white as f64 / self.noisy.max(1) as f64;
        (!values.above_one && self.at_white >= LEAST_VALUES / 4 && share > 0.05).then_some(100.0 * share)
    }

    pub(super) fn add(&mut self, more: Self) {
        self.noisy += more.noisy;
        self.at_white += more.at_white;
    }
}

/// Luminance of (1, 1, 1), however it was rounded.
fn is_white(light: f32) -> bool {
    (light - 1.0).abs() <= 4.0 * f32::EPSILON
}

/// Pixels that a thread looks at.
const AT_ONCE: usize = 1 << 16;

/// What the values of two pictures of one view have in common.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PictureValues {
    values: Values,
    ends: Ends,
}

impl PictureValues {
    /// Of two pictures with the same number of pixels.
    pub(crate) fn of([one, other]: [&[Rgb]; 2]) -> Self {
        let parts = one.par_chunks(AT_ONCE).zip(other.par_chunks(AT_ONCE));
        let of_part = |(one, other): (&[Rgb], &[Rgb])| {
            let mut part = Self::default();
            for (&a, &b) in one.iter().zip(other) {
                part.values.see(a);
                part.values.see(b);
                part.ends.add(Ends::of(luminance(a), luminance(b)));
            }
            part
        };
        let parts: Vec<Self> = parts.map(of_part).collect();
        let mut all = Self::default();
        for part in parts {
            all.values.add(&part.values);
            all.ends.add(part.ends);
        }
        all
    }

    /// How all values are 8-bit numbers, if they are and have noise: an unlit texture may be of them.
    pub(crate) fn quantised(&self) -> Option<Encoding> {
        self.values.quantised().filter(|_| self.ends.noisy > 0)
    }

    /// The share of noisy pixels whose noise ends at white, in per cent, if nothing is above.
    pub(crate) fn clipped(&self) -> Option<f64> {
        self.ends.clipped(&self.values)
    }
}

impl Sum for Ends {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        let mut sum = Self::default();
        all.for_each(|one| sum.add(one));
        sum
    }
}
