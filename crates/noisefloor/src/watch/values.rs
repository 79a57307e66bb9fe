//! The values of the first batches by themselves.

use super::said::{Encoding, Precision};
use crate::display::{luminance, srgb_encode};
use crate::rgb::Rgb;
use rayon::prelude::*;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use std::iter::Sum;

/// Watched values without which nothing is said about values.
const LEAST_VALUES: u64 = 64;

/// Different numbers, besides 0 and the largest, without which it is not said that values are such.
const LEAST_LEVELS: u32 = 8;

/// What the watched values of the first batches have in common.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(super) struct Values {
    seen: u64,
    /// How many are integers, as [`STEPS`] has them.
    steps: [Steps; STEPS.len()],
    digits: Digits,
    above_one: bool,
}

/// Integers that pictures are stored in: what 1 is, or 0 for whole numbers, the bits, whether they are sRGB-encoded, and how
/// far from a whole number rounding leads. 24 bits of a float leave 16 of an integer uncertain by 0.004, and what
/// `srgb_encode` errs by is 0.07 of their steps; of 64 other values, all lie as near with p < 10⁻³³.
const STEPS: [(u32, u32, bool, f32); 18] = [
    (255, 8, false, 0.004),
    (256, 8, false, 0.004),
    (0, 8, false, 0.004),
    (255, 8, true, 0.004),
    (256, 8, true, 0.004),
    (1023, 10, false, 0.004),
    (1024, 10, false, 0.004),
    (1023, 10, true, 0.004),
    (1024, 10, true, 0.004),
    (4095, 12, false, 0.004),
    (4096, 12, false, 0.004),
    (4095, 12, true, 0.02),
    (4096, 12, true, 0.02),
    (65_535, 16, false, 0.02),
    (65_536, 16, false, 0.02),
    (65_535, 16, true, 0.15),
    (65_536, 16, true, 0.15),
    (0, 16, false, 0.0),
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
    /// Which significands, modulo 61.
    which: u64,
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
        let significand = bits & 0x007f_ffff | 0x0080_0000;
        let digits = 24 - significand.trailing_zeros();
        self.which |= 1 << ((significand >> significand.trailing_zeros()) % 61);
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
        self.which |= more.which;
        for binade in 0..4 {
            self.all[binade] += more.all[binade];
            if more.most == self.most {
                self.with_most[binade] += more.with_most[binade];
            }
        }
    }

    /// The bits of the significand that all values were rounded to. Sums of n samples that are 0 or 1, over n, have
    /// few digits as well, but the same last place in each binade, and so the last digit in the uppermost alone; those of
    /// a few n have few significands.
    fn rounded(&self) -> Option<u32> {
        let is_used = |&(with_most, all): &(u32, u32)| all >= LEAST_IN_BINADE && 4 * with_most > all;
        let used = self.with_most.into_iter().zip(self.all).filter(is_used).count();
        (self.most <= FEW_DIGITS && used >= 2 && self.which.count_ones() >= LEAST_LEVELS).then_some(self.most)
    }
}

impl Steps {
    fn see(&mut self, level: f32, most: u32, near: f32) {
        let whole = level.round();
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
    /// Takes notice of a mean of `spp` samples. Where samples are 0 or 1, it is one of as many steps, and no picture's.
    pub(super) fn see(&mut self, pixel: Rgb, spp: u64) {
        for value in pixel {
            self.seen += 1;
            self.above_one |= value > 1.0;
            // Once a value is none, no others need be looked at
            for (steps, (white, bits, encoded, near)) in self.steps.iter_mut().zip(STEPS) {
                let explained = !encoded && u64::from(white) == spp;
                if steps.count + 1 == self.seen && !explained && (!encoded || (0.0..=1.0).contains(&value)) {
                    let (white, most) = if white > 0 { (white, white) } else { (1, (1 << bits) - 1) };
                    let level = white as f32 * if encoded { srgb_encode(value) } else { value };
                    steps.see(level, most, near);
                }
            }
            self.digits.see(value);
        }
    }

    /// Takes together what was seen of other tiles.
    pub(super) fn add(&mut self, more: &Self) {
        self.seen += more.seen;
        for (steps, more) in self.steps.iter_mut().zip(&more.steps) {
            (steps.count, steps.which) = (steps.count + more.count, steps.which | more.which);
            steps.multiples = divisor(steps.multiples, more.multiples);
        }
        self.digits.add(&more.digits);
        self.above_one |= more.above_one;
    }

    /// What integers all values are, if they are: what white is, their bits, whether they are sRGB-encoded.
    fn integers(&self) -> Option<(u32, u32, bool)> {
        let are_all = |Steps { count, multiples, which }: &Steps| {
            *count == self.seen && *multiples == 1 && which.count_ones() >= LEAST_LEVELS
        };
        let found =
            self.steps.iter().zip(STEPS).find(|(steps, _)| self.seen >= LEAST_VALUES && are_all(steps));
        found.map(|(_, (white, bits, encoded, _))| (white, bits, encoded))
    }

    /// How all values are 8-bit numbers, if they are.
    pub(super) fn quantised(&self) -> Option<Encoding> {
        let (_, bits, encoded) = self.integers()?;
        (bits == 8).then_some(if encoded { Encoding::Srgb } else { Encoding::Linear })
    }

    /// What coarser numbers all values are, if they are.
    pub(super) fn precision(&self) -> Option<Precision> {
        let integers =
            self.integers().map(|(white, bits, _)| Precision::Integers { bits, whole: white == 0 });
        let floats = || self.digits.rounded().filter(|_| self.seen >= LEAST_VALUES);
        integers.or_else(|| floats().map(|bits| Precision::Floats { bits }))
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
                part.values.see(a, 0);
                part.values.see(b, 0);
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
