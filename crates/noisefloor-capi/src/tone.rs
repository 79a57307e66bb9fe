//! A tone mapping of the caller's own, as a table.

use crate::border;
use crate::handle;
use crate::session::NfSession;
use crate::status::{Failure, NfStatus, guard};
use noisefloor::{Rgb, ToneMapping, display::ToneCurve};

/// Entries along an edge. More than 65 are larger than a processor's cache.
const EDGES: std::ops::RangeInclusive<usize> = 2..=65;

/// Displays radiance by a table of the caller's own, such as a filmic curve, before the first verdict: then
/// tone_mapping and exposure of NfParams count no more. table has edge entries along each axis, 2 to 65, red
/// fastest: floats = 3 * edge^3 display values (sRGB-encoded red, green and blue, 0 to 1). Radiance x, times
/// exposure, lies at s(1 + x / toe) / s(1 + top / toe) of an axis, where s(2^n * (1 + f)) = n + f is log2
/// made linear between powers of two: 0 is the first entry and top, or more, the last. Between entries
/// values are interpolated linearly. Tables are kept until the program ends, each once.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_set_tone_table(
    session: *const NfSession,
    exposure: f32,
    toe: f32,
    top: f32,
    table: *const f32,
    floats: usize,
    edge: usize,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        let wrong = |message: String| Err(Failure::new(NfStatus::Argument, message));
        if !EDGES.contains(&edge) {
            return wrong(format!("a tone table has an edge of 2 to 65 entries, not {edge}"));
        }
        if !(toe > 0.0 && toe < top && (top / toe).is_finite()) {
            return wrong(format!("toe = {toe} and top = {top} of a tone table must be 0 < toe < top"));
        }
        // SAFETY: promised by the caller.
        let values = unsafe { border::array(table, floats, 3 * edge.pow(3), "table") }?;
        if let Some(place) = values.iter().position(|value| !value.is_finite()) {
            return wrong(format!("value {place} of the tone table is not finite"));
        }
        let scale = (edge - 1) as f32 / stops(1.0 + top / toe);
        let curve = Table { edge, toe, scale, values: values.to_vec() };
        let tone = ToneMapping::Custom { exposure, curve: curve.into_tone_curve() };
        tone.check().map_err(|error| Failure::new(NfStatus::Argument, error.to_string()))?;
        Ok(session.lock()?.set_display(tone.settle(&[]))?)
    })
}

struct Table {
    edge: usize,
    toe: f32,
    /// Of stops, to places on an axis.
    scale: f32,
    values: Vec<f32>,
}

/// log2 of 1 and more, made linear between powers of two: as good for a table, faster, and the same to the
/// bit on every machine.
fn stops(x: f32) -> f32 {
    const ONE: u32 = 1.0_f32.to_bits();
    (x.max(1.0).to_bits() - ONE) as f32 / (1 << 23) as f32
}

impl Table {
    fn into_tone_curve(self) -> ToneCurve {
        let numbers = [self.edge as f32, self.toe, self.scale];
        let bytes = numbers.iter().chain(&self.values).flat_map(|number| number.to_le_bytes());
        let identity: Vec<u8> = b"tone table".iter().copied().chain(bytes).collect();
        ToneCurve::new(&identity, move |exposed| self.show(exposed))
    }

    /// Between the eight entries around a colour.
    fn show(&self, exposed: Rgb) -> Rgb {
        let last = (self.edge - 1) as f32;
        let place = |x: f32| {
            let place = (stops(1.0 + x / self.toe) * self.scale).min(last);
            let below = (place as usize).min(self.edge - 2);
            (below, place - below as f32)
        };
        let [(r, x), (g, y), (b, z)] = exposed.map(place);
        let row = |g: usize, b: usize| {
            let first = 3 * ((b * self.edge + g) * self.edge + r);
            let two = &self.values[first..first + 6];
            mix([two[0], two[1], two[2]], [two[3], two[4], two[5]], x)
        };
        let plane = |b: usize| mix(row(g, b), row(g + 1, b), y);
        mix(plane(b), plane(b + 1), z)
    }
}

fn mix(a: Rgb, b: Rgb, share: f32) -> Rgb {
    std::array::from_fn(|c| a[c] + (b[c] - a[c]) * share)
}
