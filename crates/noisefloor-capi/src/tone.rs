//! A tone mapping of the caller's own, as a table.

use crate::border;
use crate::handle;
use crate::session::NfSession;
use crate::status::{Failure, NfStatus, guard};
use noisefloor::{
    ToneMapping,
    display::{ToneTable, ToneTableError},
};

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
        let wrong = |error: ToneTableError| Failure::new(NfStatus::Argument, error.to_string());
        // Before the table, whose length follows from its edge
        ToneTable::radiances(edge, toe, top).map_err(wrong)?;
        // SAFETY: promised by the caller.
        let values = unsafe { border::array(table, floats, 3 * edge.pow(3), "table") }?;
        let table = ToneTable::new(edge, toe, top, values.as_chunks().0.to_vec()).map_err(wrong)?;
        let tone = ToneMapping::Custom { exposure, curve: table.into_tone_curve() };
        tone.check().map_err(|error| Failure::new(NfStatus::Argument, error.to_string()))?;
        Ok(session.lock()?.set_display(tone.settle(&[]))?)
    })
}
