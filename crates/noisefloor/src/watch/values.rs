//! The values of the first batches by themselves.

use super::{Encoding, LEAST_VALUES, Warning};
use crate::display::srgb_encode;
use crate::rgb::Rgb;
use serde::{Deserialize, Serialize};
use std::iter::Sum;

/// Distance from a whole number of 255ths that is rounding.
const NEAR: f32 = 4e-3;
/// Different numbers of 8 bits, besides 0 and 255, without which it is not said that values are such.
const LEAST_LEVELS: u32 = 8;

/// What the watched values of the first batches have in common.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Values {
    seen: u64,
    /// How many are 8-bit numbers, and which: divided by 255, sRGB-decoded, whole.
    levels: [Levels; 3],
    first: Option<Rgb>,
    varied: bool,
    pub(super) above_one: bool,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Levels {
    count: u64,
    which: [u64; 4],
}

impl Levels {
    fn see(&mut self, level: f32) {
        let near = level.round();
        if (level - near).abs() <= NEAR && (0.0..=255.0).contains(&near) {
            self.count += 1;
            let number = near as usize;
            self.which[number / 64] |= 1 << (number % 64);
        }
    }

    fn are_all(&self, of: u64) -> bool {
        let [low, .., high] = self.which;
        let ends = (low & 1).count_ones() + (high >> 63) as u32;
        let levels: u32 = self.which.iter().map(|word| word.count_ones()).sum();
        self.count == of && levels - ends >= LEAST_LEVELS
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
        }
    }

    /// Takes together what was seen of other tiles.
    pub(super) fn add(&mut self, more: &Self) {
        self.seen += more.seen;
        for (levels, more) in self.levels.iter_mut().zip(more.levels) {
            levels.count += more.count;
            levels.which.iter_mut().zip(more.which).for_each(|(which, more)| *which |= more);
        }
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

    pub(super) fn constant(&self) -> Option<Warning> {
        let said = self.seen >= LEAST_VALUES && !self.varied;
        self.first.filter(|_| said).map(|pixel| Warning::Constant(pixel[1]))
    }
}

/// Noisy pixels, and those of them of which one batch of two is exactly 1.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Ends {
    pub(super) noisy: u64,
    pub(super) at_white: u64,
}

impl Ends {
    pub(super) fn of(a: f32, b: f32) -> Self {
        let noisy = u64::from(a.to_bits() != b.to_bits());
        Self { noisy, at_white: noisy * u64::from(is_white(a.max(b))) }
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

impl Sum for Ends {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        let mut sum = Self::default();
        all.for_each(|one| sum.add(one));
        sum
    }
}
