//! Tone mappings that somebody else has: a LUT, or any function.

use crate::rgb::Rgb;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// A function from exposed linear radiance to display values; alive as long as the program.
type Map = &'static (dyn Fn(Rgb) -> Rgb + Send + Sync);

/// A tone mapping of the caller's own, for [`crate::ToneMapping::Custom`]: a filmic curve, a LUT, a closure.
///
/// Files keep its digest, because a function cannot be written down. A checkpoint is resumed with the
/// function that its session had, and refused with another one.
///
/// ```
/// use noisefloor::{Params, ToneMapping, display::ToneCurve};
///
/// // Hable's filmic curve, with a white point of 11.2; encoded for an sRGB screen
/// fn hable(x: f32) -> f32 {
///     ((x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.5) + 0.06)) - 0.02 / 0.3
/// }
/// let filmic = ToneCurve::new(b"Hable, white 11.2", &|exposed| {
///     exposed.map(|x| noisefloor::display::srgb_encode(hable(2.0 * x) / hable(11.2)))
/// });
/// let params = Params {
///     tone_mapping: ToneMapping::Custom { exposure: 1.0, curve: filmic },
///     ..Params::default()
/// };
/// assert!(params.check().is_ok());
/// ```
#[derive(Clone, Copy)]
pub struct ToneCurve {
    digest: [u8; 32],
    /// None once it has been in a file.
    map: Option<Map>,
}

impl ToneCurve {
    /// A curve from exposed linear radiance, at least 0 and finite, to display-encoded sRGB. What it returns
    /// is clamped to [0, 1]; NaN becomes 0. It must return the same for the same radiance. `identity` is all
    /// that tells it from other curves: a name with a version and parameters, or the contents of a LUT.
    ///
    /// A plain function and a closure that captures nothing live as long as the program. One that captures
    /// something does so by `Box::leak`, which a program does once for each LUT that it loads.
    pub fn new(identity: &[u8], map: &'static (dyn Fn(Rgb) -> Rgb + Send + Sync)) -> Self {
        Self { digest: *blake3::hash(identity).as_bytes(), map: Some(map) }
    }

    /// BLAKE3 of its identity, hexadecimal.
    pub fn digest(&self) -> String {
        blake3::Hash::from_bytes(self.digest).to_hex().to_string()
    }

    /// Whether it has its function; not if it comes from a file.
    pub fn is_complete(&self) -> bool {
        self.map.is_some()
    }

    /// Exposed linear radiance → display values in [0, 1]. Without its function, plain sRGB.
    pub(crate) fn show(&self, exposed: Rgb) -> Rgb {
        let shown = self.map.map_or_else(|| exposed.map(crate::display::srgb_encode), |map| map(exposed));
        shown.map(|c| if c > 0.0 { c.min(1.0) } else { 0.0 })
    }
}

impl PartialEq for ToneCurve {
    fn eq(&self, other: &Self) -> bool {
        self.digest == other.digest
    }
}

impl fmt::Debug for ToneCurve {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ToneCurve({})", self.digest())
    }
}

impl Serialize for ToneCurve {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(&self.digest())
    }
}

impl<'de> Deserialize<'de> for ToneCurve {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        let hash = blake3::Hash::from_hex(text.as_bytes()).map_err(serde::de::Error::custom)?;
        Ok(Self { digest: *hash.as_bytes(), map: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_it_returns_has_a_place_on_the_screen() {
        let odd = ToneCurve::new(b"odd", &|[r, _, _]| [f32::NAN, -r, f32::INFINITY]);
        assert_eq!(odd.show([2.0; 3]), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn curves_are_told_apart_by_what_they_are() {
        let (a, b) = (ToneCurve::new(b"a", &|x| x), ToneCurve::new(b"b", &|x| x));
        assert!(a == a && a != b);
        assert_eq!(format!("{a:?}"), format!("ToneCurve({})", blake3::hash(b"a").to_hex()));
    }
}
