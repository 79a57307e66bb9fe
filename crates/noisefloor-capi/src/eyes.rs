//! Whose eyes, as `noisefloor calibrate` has measured them.

use crate::border;
use crate::status::{Failure, NfStatus, guard};
use noisefloor::{Audience, Model, Viewing};
use noisefloor_eyes::{Eyes, EyesError};
use std::ffi::c_char;
use std::path::Path;

/// Reads what `noisefloor calibrate` has measured: for NfParams.audience_slope and NfParams.viewing. path is a
/// file, of whose people nine of ten will be content; NULL is the user's own, and if nobody is calibrated,
/// slope is 1 and viewing the default. viewing is cut to bytes - 1 bytes and ended by a zero; 200 bytes hold
/// any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_eyes(
    path: *const c_char,
    slope: *mut f64,
    viewing: *mut c_char,
    bytes: usize,
) -> NfStatus {
    guard(|| {
        let eyes = if path.is_null() {
            Eyes::own()?
        } else {
            // SAFETY: promised by the caller.
            Some(Eyes::read(Path::new(unsafe { border::text(path, "path") }?))?)
        };
        let eyes = eyes.map(|eyes| eyes.beside(&Model::bundled().digest()).unwrap_or(eyes));
        let (audience, seen) = match &eyes {
            Some(eyes) => (eyes.strictest().audience(), eyes.strictest().viewing()),
            None => (Audience::TRAINED, Viewing::default()),
        };
        // SAFETY: promised by the caller.
        unsafe { border::write_text(viewing, bytes, &seen.to_string(), "viewing") }?;
        // SAFETY: promised by the caller.
        unsafe { border::write(slope, audience.slope, "slope") }
    })
}

impl From<EyesError> for Failure {
    fn from(error: EyesError) -> Self {
        let status = if matches!(error, EyesError::Io { .. }) { NfStatus::Io } else { NfStatus::Argument };
        Self::new(status, error.to_string())
    }
}
