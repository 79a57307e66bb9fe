//! Tone mappings of the caller's own: tables, and `.cube` files.

use crate::border;
use crate::handle;
use crate::status::{Failure, NfStatus, guard};
use noisefloor::display::{LutInput, LutInputError, ToneCurve, ToneTableError, parse_cube};
use std::ffi::c_char;

/// How radiance is displayed, for NfParams: a table, or a .cube file.
pub struct NfTone(pub(crate) ToneCurve);

impl handle::Handle for NfTone {
    const NAME: &str = "tone";
}

/// A .cube file: a 1D LUT, a 3D LUT, or a 1D one before a 3D one. text is its content, bytes long. input says how
/// radiance is encoded before it: "linear" (also NULL), "srgb", "acescct", or "log2:LOW,HIGH" for stops from middle grey
/// (0.18) that become 0 and 1. What it returns is taken for sRGB-encoded display values. The caller frees it with
/// nf_tone_free, parameters and sessions keep what they need.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_tone_of_cube(
    text: *const c_char,
    bytes: usize,
    input: *const c_char,
    tone: *mut *mut NfTone,
) -> NfStatus {
    guard(|| {
        let make = || {
            let wrong = |why: String| Failure::new(NfStatus::Argument, why);
            let input = if input.is_null() {
                LutInput::Linear
            } else {
                // SAFETY: not null, so promised by the caller.
                let name = unsafe { border::text(input, "input") }?;
                name.parse().map_err(|error: LutInputError| wrong(error.to_string()))?
            };
            // SAFETY: promised by the caller.
            let text = unsafe { border::array(text.cast::<u8>(), bytes, bytes, "text") }?;
            let lut = parse_cube(text).map_err(|error| wrong(format!("no .cube file: {error}")))?;
            Ok(NfTone(lut.into_tone_curve(input)))
        };
        // SAFETY: promised by the caller.
        unsafe { handle::give(tone, make) }
    })
}

/// A table of display values over radiance, such as a filmic curve, with edge entries along each axis, 2 to 65, red
/// fastest: floats = 3 * edge^3 display values (sRGB-encoded red, green and blue, 0 to 1). Radiance x, times
/// exposure, lies at s(1 + x / toe) / s(1 + top / toe) of an axis, where s(2^n * (1 + f)) = n + f is log2
/// made linear between powers of two: 0 is the first entry and top, or more, the last. Between entries
/// values are interpolated linearly. NF_STATUS_ARGUMENT if the values are no display values, such as those of 8 bits. The
/// caller frees it with nf_tone_free, parameters and sessions keep what they need.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_tone_of_table(
    toe: f32,
    top: f32,
    table: *const f32,
    floats: usize,
    edge: usize,
    tone: *mut *mut NfTone,
) -> NfStatus {
    guard(|| {
        let make = || {
            let wrong = |error: ToneTableError| Failure::new(NfStatus::Argument, error.to_string());
            // Before the table, whose length follows from its edge
            ToneCurve::table_radiances(edge, toe, top).map_err(wrong)?;
            // SAFETY: promised by the caller.
            let values = unsafe { border::array(table, floats, 3 * edge.pow(3), "table") }?;
            let curve = ToneCurve::of_table(edge, toe, top, values.as_chunks().0.to_vec());
            Ok(NfTone(curve.map_err(wrong)?))
        };
        // SAFETY: promised by the caller.
        unsafe { handle::give(tone, make) }
    })
}

/// Frees a tone mapping. NULL is ignored, a second time is NF_STATUS_HANDLE.
#[unsafe(no_mangle)]
pub extern "C" fn nf_tone_free(tone: *mut NfTone) -> NfStatus {
    guard(|| handle::free(tone))
}
