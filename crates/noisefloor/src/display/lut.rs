//! Colour look-up tables as tone mappings.

use super::{srgb::srgb_encode, tone_curve::ToneCurve};
use crate::rgb::Rgb;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Middle grey, which stops of [`LutInput::Log2`] are counted from.
const GREY: f32 = 0.18;

/// A 1D LUT of each channel, a 3D LUT, or one after the other. Values between entries are interpolated
/// linearly, and those outside its range are those at its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourLut {
    curve: Option<LutTable>,
    cube: Option<LutTable>,
}

/// Entries, evenly spaced over a range.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LutTable {
    /// Along an edge, at least 2.
    pub(crate) size: usize,
    /// Of each channel: the inputs of the first and the last entry.
    pub(crate) range: [Rgb; 2],
    /// `size` entries of a 1D LUT, `size`³ of a 3D one, red fastest.
    pub(crate) values: Vec<Rgb>,
}

impl LutTable {
    /// The entry below the input of a channel, and how far it is from there to the next one.
    fn place(&self, input: f32, channel: usize) -> (usize, f32) {
        let [low, high] = self.range.map(|end| end[channel]);
        let last = (self.size - 1) as f32;
        let place = (input - low) / (high - low) * last;
        let place = if place > 0.0 { place.min(last) } else { 0.0 }; // NaN becomes 0
        let below = (place as usize).min(self.size - 2);
        (below, place - below as f32)
    }

    fn curve(&self, input: Rgb) -> Rgb {
        std::array::from_fn(|c| {
            let (below, share) = self.place(input[c], c);
            mix(self.values[below], self.values[below + 1], share)[c]
        })
    }

    fn cube(&self, input: Rgb) -> Rgb {
        let [(r, x), (g, y), (b, z)] = [0, 1, 2].map(|c| self.place(input[c], c));
        let at = |r: usize, g: usize, b: usize| self.values[(b * self.size + g) * self.size + r];
        let row = |g, b| mix(at(r, g, b), at(r + 1, g, b), x);
        let plane = |b| mix(row(g, b), row(g + 1, b), y);
        mix(plane(b), plane(b + 1), z)
    }

    fn bytes(&self) -> impl Iterator<Item = u8> + '_ {
        let size = (self.size as u64).to_le_bytes();
        let numbers = self.range.iter().chain(&self.values).flatten();
        size.into_iter().chain(numbers.flat_map(|v| v.to_le_bytes()))
    }
}

fn mix(a: Rgb, b: Rgb, share: f32) -> Rgb {
    std::array::from_fn(|c| a[c] * (1.0 - share) + b[c] * share)
}

impl ColourLut {
    pub(crate) fn new(curve: Option<LutTable>, cube: Option<LutTable>) -> Self {
        Self { curve, cube }
    }

    /// Any colour → what the LUT makes of it.
    pub fn map(&self, input: Rgb) -> Rgb {
        let curved = self.curve.as_ref().map_or(input, |table| table.curve(input));
        self.cube.as_ref().map_or(curved, |table| table.cube(curved))
    }

    /// The LUT as a tone mapping: exposed linear radiance (Rec.709 primaries) is encoded as `input` says, and
    /// what the LUT returns is taken for display-encoded sRGB. The curve owns the LUT. Its identity is its content, not
    /// its file.
    pub fn into_tone_curve(self, input: LutInput) -> ToneCurve {
        self.encoded(&input.to_string(), move |c| input.encode(c))
    }

    /// The same with any encoding, called so.
    pub(crate) fn encoded(self, by: &str, encode: impl Fn(f32) -> f32 + Send + Sync + 'static) -> ToneCurve {
        let mut identity = format!("lut {by}").into_bytes();
        for table in [&self.curve, &self.cube] {
            identity.push(u8::from(table.is_some()));
            identity.extend(table.iter().flat_map(LutTable::bytes));
        }
        ToneCurve::new(&identity, move |exposed| self.map(exposed.map(&encode)))
    }
}

/// How linear radiance is encoded before a LUT.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum LutInput {
    /// Not at all: the LUT takes linear light, within its domain.
    #[default]
    Linear,
    /// As sRGB, clamped to [0, 1].
    Srgb,
    /// As stops from middle grey (0.18): the first number becomes 0, the second 1.
    Log2(f32, f32),
    /// As ACEScct (S-2016-001), without a change of primaries.
    AcesCct,
}

impl LutInput {
    /// One channel of exposed radiance, at least 0.
    pub fn encode(self, linear: f32) -> f32 {
        match self {
            Self::Linear => linear,
            Self::Srgb => srgb_encode(linear),
            Self::Log2(low, high) => {
                let stops = (linear.max(f32::MIN_POSITIVE) / GREY).log2();
                ((stops - low) / (high - low)).clamp(0.0, 1.0)
            }
            Self::AcesCct if linear <= 0.007_812_5 => 10.540_238 * linear + 0.072_905_53,
            Self::AcesCct => (linear.log2() + 9.72) / 17.52,
        }
    }
}

impl fmt::Display for LutInput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Linear => write!(f, "linear"),
            Self::Srgb => write!(f, "srgb"),
            Self::Log2(low, high) => write!(f, "log2:{low},{high}"),
            Self::AcesCct => write!(f, "acescct"),
        }
    }
}

/// Text that names no encoding.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error(
    "{0:?} is no input of a LUT: expected linear, srgb, acescct, or log2:LOW,HIGH in stops from middle grey, \
     such as log2:-10,6.5"
)]
pub struct LutInputError(String);

impl FromStr for LutInput {
    type Err = LutInputError;

    fn from_str(text: &str) -> Result<Self, LutInputError> {
        let stops = || {
            let (low, high) = text.strip_prefix("log2:")?.split_once(',')?;
            let (low, high) = (low.trim().parse::<f32>().ok()?, high.trim().parse::<f32>().ok()?);
            (low.is_finite() && high.is_finite() && low < high).then_some(Self::Log2(low, high))
        };
        match text {
            "linear" => Ok(Self::Linear),
            "srgb" => Ok(Self::Srgb),
            "acescct" => Ok(Self::AcesCct),
            _ => stops().ok_or_else(|| LutInputError(text.to_owned())),
        }
    }
}
