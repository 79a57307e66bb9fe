//! Tone mappings that somebody else has: a LUT, or any function.

use crate::rgb::Rgb;
#[cfg(feature = "files")]
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};
use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

/// A function from exposed linear radiance to display values.
type Map = dyn Fn(Rgb) -> Rgb + Send + Sync;

/// What tells a curve from others: BLAKE3 of its identity, which files keep.
#[cfg(feature = "files")]
type Key = [u8; 32];
/// What tells a curve from others: its identity.
#[cfg(not(feature = "files"))]
type Key = Vec<u8>;

fn key(identity: &[u8]) -> Key {
    #[cfg(feature = "files")]
    {
        *blake3::hash(identity).as_bytes()
    }
    #[cfg(not(feature = "files"))]
    {
        identity.to_vec()
    }
}

/// The functions of all curves that there are, by the digest of their identity: one that is read from a file
/// has its function if this program holds the curve.
static CURVES: Mutex<BTreeMap<Key, Weak<Map>>> = Mutex::new(BTreeMap::new());

fn curves() -> MutexGuard<'static, BTreeMap<Key, Weak<Map>>> {
    CURVES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A tone mapping of the caller's own, for [`crate::ToneMapping::Custom`]: a filmic curve, a LUT, a closure.
///
/// Files keep its digest, because a function cannot be written down. Make the curve again before you read one,
/// and hold it meanwhile: a digest without a curve is an error, so that no curve is without its function.
///
/// ```
/// use noisefloor::display::{Display, ToneCurve};
/// use noisefloor::{Params, ToneMapping};
///
/// // Hable's filmic curve, with a white point of 11.2; encoded for an sRGB screen
/// fn hable(x: f32) -> f32 {
///     ((x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.5) + 0.06)) - 0.02 / 0.3
/// }
/// let filmic = ToneCurve::new(b"Hable, white 11.2", |exposed| {
///     Display::SRGB.encode(exposed.map(|x| hable(2.0 * x) / hable(11.2)))
/// });
/// let params = Params::default().with_tone_mapping(ToneMapping::Custom { exposure: 1.0, curve: filmic });
/// assert!(params.check().is_ok());
/// ```
#[derive(Clone)]
pub struct ToneCurve {
    key: Key,
    map: Arc<Map>,
}

impl ToneCurve {
    /// A curve from exposed linear radiance, at least 0 and finite, to display-encoded sRGB. What it returns
    /// is clamped to [0, 1]; NaN becomes 0. It must return the same for the same radiance. `identity` is all
    /// that tells it from other curves: a name with a version and parameters, or the contents of a LUT. Of two
    /// functions with one identity the first is used, as long as one of its curves is there.
    #[cfg_attr(feature = "files", expect(clippy::clone_on_copy, reason = "without files, it is no array"))]
    pub fn new(identity: &[u8], map: impl Fn(Rgb) -> Rgb + Send + Sync + 'static) -> Self {
        let key = key(identity);
        let mut curves = curves();
        curves.retain(|_, kept| kept.strong_count() > 0);
        let kept = curves.get(&key).and_then(Weak::upgrade);
        let map = kept.unwrap_or_else(|| Arc::new(map));
        curves.insert(key.clone(), Arc::downgrade(&map));
        Self { key, map }
    }

    /// BLAKE3 of its identity, hexadecimal.
    #[cfg(feature = "files")]
    pub fn digest(&self) -> String {
        blake3::Hash::from_bytes(self.key).to_hex().to_string()
    }

    /// Exposed linear radiance → display values in [0, 1].
    pub(crate) fn show(&self, exposed: Rgb) -> Rgb {
        (self.map)(exposed).map(|c| if c > 0.0 { c.min(1.0) } else { 0.0 })
    }
}

impl PartialEq for ToneCurve {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

impl fmt::Debug for ToneCurve {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        #[cfg(feature = "files")]
        let name = self.digest();
        #[cfg(not(feature = "files"))]
        let name = String::from_utf8_lossy(&self.key);
        write!(f, "ToneCurve({name})")
    }
}

#[cfg(feature = "files")]
impl Serialize for ToneCurve {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(&self.digest())
    }
}

#[cfg(feature = "files")]
impl<'de> Deserialize<'de> for ToneCurve {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        let hash = blake3::Hash::from_hex(text.as_bytes()).map_err(D::Error::custom)?;
        let digest = *hash.as_bytes();
        let map = curves().get(&digest).and_then(Weak::upgrade);
        let unknown = || {
            D::Error::custom(format_args!("its tone curve {text} is another one: give the LUT that it had"))
        };
        map.map(|map| Self { key: digest, map }).ok_or_else(unknown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_it_returns_has_a_place_on_the_screen() {
        let odd = ToneCurve::new(b"odd", |[r, _, _]| [f32::NAN, -r, f32::INFINITY]);
        assert_eq!(odd.show([2.0; 3]), [0.0, 0.0, 1.0]);
    }

    /// A function goes with its last curve; until then, a second one of the same identity is not used.
    #[test]
    fn a_function_lives_as_long_as_its_curves() {
        let held = Arc::new(());
        let inner = Arc::clone(&held);
        let first = ToneCurve::new(b"held", move |exposed| {
            let _ = &inner;
            exposed
        });
        let second = ToneCurve::new(b"held", |_| [0.0; 3]);
        assert_eq!((Arc::strong_count(&held), second.show([0.5; 3])), (2, [0.5; 3]));
        drop((first, second));
        assert_eq!(Arc::strong_count(&held), 1);
        assert_eq!(ToneCurve::new(b"held", |_| [0.0; 3]).show([0.5; 3]), [0.0; 3]);
    }

    #[test]
    fn curves_are_told_apart_by_what_they_are() {
        let (a, b) = (ToneCurve::new(b"a", |x| x), ToneCurve::new(b"b", |x| x));
        assert!(a == a && a != b);
        assert_eq!(format!("{a:?}"), format!("ToneCurve({})", blake3::hash(b"a").to_hex()));
    }
}
