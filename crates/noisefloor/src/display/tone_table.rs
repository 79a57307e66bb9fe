//! A tone mapping as a table of colours over stops.

use super::ToneCurve;
use super::lut::{ColourLut, LutTable};
use crate::rgb::Rgb;
use std::ops::RangeInclusive;
use thiserror::Error;

/// Entries along an edge. More than 65 are larger than a processor's cache.
const EDGES: RangeInclusive<usize> = 2..=65;

/// A table that cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ToneTableError {
    /// Its edge.
    #[error("a tone table has an edge of 2 to 65 entries, not {0}")]
    Edge(usize),
    /// Its range.
    #[error("toe = {toe} and top = {top} of a tone table must be 0 < toe < top")]
    Range {
        /// Where it begins to be logarithmic.
        toe: f32,
        /// Where it ends.
        top: f32,
    },
    /// Too few values, or too many.
    #[error("a tone table with an edge of {edge} has {} entries, not {got}", edge.pow(3))]
    Entries {
        /// Its edge.
        edge: usize,
        /// Entries given.
        got: usize,
    },
    /// A value is no display value.
    #[error(
        "value {place} of the tone table is {value}: display values are sRGB-encoded and lie from 0 to 1; \
         divide those of 8 bits by 255"
    )]
    Value {
        /// Its place among all numbers.
        place: usize,
        /// The value.
        value: f32,
    },
}

/// How far beyond 0 and 1 a display value may lie, as a curve that is not cut off reaches: what is shown is cut off.
const BEYOND: f32 = 0.5;

impl ToneCurve {
    /// A table of display values over radiance, for pictures that are shown by more than a curve: AgX, a look, a
    /// studio's own pipeline. Its identity is its content.
    ///
    /// `values` are `edge`³ display values (sRGB-encoded, 0 to 1), red fastest, blue slowest. Values up to a half beyond
    /// these ends are cut off where they are shown. Exposed radiance x lies at s(1 + x / toe) / s(1 + top / toe) of each
    /// axis, where s(2ⁿ·(1 + f)) = n + f is log2 made linear between powers of two: 0 is the first entry, and `top` or
    /// more the last. Between entries values are interpolated linearly.
    ///
    /// # Errors
    /// [`ToneTableError`].
    pub fn of_table(edge: usize, toe: f32, top: f32, values: Vec<Rgb>) -> Result<Self, ToneTableError> {
        let end = end(edge, toe, top)?;
        if values.len() != edge.pow(3) {
            return Err(ToneTableError::Entries { edge, got: values.len() });
        }
        let off = values.as_flattened().iter().enumerate().find(|(_, value)| !is_displayable(**value));
        if let Some((place, &value)) = off {
            return Err(ToneTableError::Value { place, value });
        }
        let cube = LutTable { size: edge, range: [[0.0; 3], [end; 3]], values };
        let encode = move |x: f32| stops(1.0 + x / toe);
        Ok(ColourLut::new(None, Some(cube)).encoded(&format!("table {toe}"), encode))
    }

    /// The radiances of the entries along an axis of [`Self::of_table`]: what a renderer shows of them is the table.
    ///
    /// # Errors
    /// [`ToneTableError`] if there is no such table.
    pub fn table_radiances(edge: usize, toe: f32, top: f32) -> Result<Vec<f32>, ToneTableError> {
        let scale = (edge as f32 - 1.0) / end(edge, toe, top)?;
        let at = |entry: usize| {
            let stops = entry as f32 / scale;
            toe * (stops.floor().exp2() * (1.0 + stops.fract()) - 1.0)
        };
        Ok((0..edge).map(at).collect())
    }
}

/// Whether that may be shown, and cut off at the ends of the display.
pub(super) fn is_displayable(value: f32) -> bool {
    (-BEYOND..=1.0 + BEYOND).contains(&value)
}

/// Stops at the last entry of an axis.
fn end(edge: usize, toe: f32, top: f32) -> Result<f32, ToneTableError> {
    if !EDGES.contains(&edge) {
        return Err(ToneTableError::Edge(edge));
    }
    if !(toe > 0.0 && toe < top && (top / toe).is_finite()) {
        return Err(ToneTableError::Range { toe, top });
    }
    Ok(stops(1.0 + top / toe))
}

/// log2 of 1 and more, made linear between powers of two: as good for a table, faster, and the same to the
/// bit on every machine.
fn stops(x: f32) -> f32 {
    const ONE: u32 = 1.0_f32.to_bits();
    (x.max(1.0).to_bits() - ONE) as f32 / (1 << 23) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::ToneMapping;

    #[test]
    fn a_table_shows_its_entries_as_they_are() {
        let (edge, toe, top) = (17, 1e-3, 1e3);
        let radiances = ToneCurve::table_radiances(edge, toe, top).unwrap();
        assert!(radiances[0] == 0.0 && (radiances[16] / top - 1.0).abs() < 1e-4, "{radiances:?}");
        let shown =
            |r: f32, g: f32, b: f32| [r / (1.0 + g), g / (1.0 + b), b / (1.0 + r)].map(|v| v.min(1.0));
        let values: Vec<Rgb> = radiances
            .iter()
            .flat_map(|&b| {
                let radiances = &radiances;
                radiances.iter().flat_map(move |&g| radiances.iter().map(move |&r| shown(r, g, b)))
            })
            .collect();
        let curve = ToneCurve::of_table(edge, toe, top, values).unwrap();
        let display = ToneMapping::Custom { exposure: 2.0, curve }.settle(&[]);
        for (r, g, b) in [(0, 0, 0), (3, 7, 12), (16, 2, 5)] {
            let [r, g, b] = [r, g, b].map(|entry| radiances[entry]);
            let (got, right) = (display.encode([r / 2.0, g / 2.0, b / 2.0]), shown(r, g, b));
            assert!((0..3).all(|c| (got[c] - right[c]).abs() < 1e-4), "{got:?} {right:?}");
        }
        assert_eq!(
            ToneCurve::of_table(2, 0.1, 1.0, vec![[0.0; 3]; 7]),
            Err(ToneTableError::Entries { edge: 2, got: 7 })
        );
        assert_eq!(ToneCurve::table_radiances(1, 0.1, 1.0), Err(ToneTableError::Edge(1)));
        let nan = ToneCurve::of_table(2, 0.1, 1.0, vec![[0.0, f32::NAN, 0.0]; 8]);
        assert!(matches!(nan, Err(ToneTableError::Value { place: 1, .. })), "{nan:?}");
        // Those of 8 bits, and of a byte that means white
        for (value, fits) in [(255.0, false), (2.0, false), (-1.0, false), (1.02, true), (-0.01, true)] {
            let table = ToneCurve::of_table(2, 0.1, 1.0, vec![[0.0, 0.0, value]; 8]);
            assert_eq!(table.is_ok(), fits, "{table:?}");
        }
    }
}
