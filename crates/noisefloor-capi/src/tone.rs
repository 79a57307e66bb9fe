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

/// A table: see nf_session_set_tone_table. The caller frees it with nf_tone_free, parameters and sessions keep what they
/// need.
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
        // SAFETY: promised by the caller.
        unsafe { handle::give(tone, || Ok(NfTone(curve((toe, top), table, floats, edge)?))) }
    })
}

/// Frees a tone mapping. NULL is ignored, a second time is NF_STATUS_HANDLE.
#[unsafe(no_mangle)]
pub extern "C" fn nf_tone_free(tone: *mut NfTone) -> NfStatus {
    guard(|| handle::free(tone))
}

/// A curve of a table.
///
/// # Safety
/// As [`border::array`].
pub(crate) unsafe fn curve(
    (toe, top): (f32, f32),
    table: *const f32,
    floats: usize,
    edge: usize,
) -> Result<ToneCurve, Failure> {
    let wrong = |error: ToneTableError| Failure::new(NfStatus::Argument, error.to_string());
    // Before the table, whose length follows from its edge
    ToneCurve::table_radiances(edge, toe, top).map_err(wrong)?;
    // SAFETY: as for this function.
    let values = unsafe { border::array(table, floats, 3 * edge.pow(3), "table") }?;
    ToneCurve::of_table(edge, toe, top, values.as_chunks().0.to_vec()).map_err(wrong)
}
