//! Oracles.

use crate::border;
use crate::status::{Failure, NfStatus, guard};
use noisefloor::{Model, Oracle, Threshold};
use std::ffi::c_char;
use std::fs::File;

/// A trained model with the probability from which a tile counts as converged. It never changes, and any
/// number of sessions can be made from it.
pub struct NfOracle(pub(crate) Oracle);

/// Makes an oracle from the model inside the library, which was trained on human data and judges by half
/// buffers. threshold lies between 0 and 1; 0.9 is that of the paper. The caller frees the oracle with
/// nf_oracle_free.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_oracle_bundled(threshold: f32, oracle: *mut *mut NfOracle) -> NfStatus {
    guard(|| {
        let make = || Ok(NfOracle(Oracle::new(Model::bundled(), Threshold::new(threshold)?)));
        // SAFETY: promised by the caller.
        unsafe { border::give(oracle, "oracle", make) }
    })
}

/// As nf_oracle_bundled, with a model that "noisefloor-lab train" has written to a file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_oracle_load(
    path: *const c_char,
    threshold: f32,
    oracle: *mut *mut NfOracle,
) -> NfStatus {
    guard(|| {
        // SAFETY: promised by the caller.
        let path = unsafe { border::text(path, "path") }?;
        let make = || {
            let file =
                File::open(path).map_err(|error| Failure::new(NfStatus::Io, format!("{path}: {error}")))?;
            Ok(NfOracle(Oracle::new(Model::read(file)?, Threshold::new(threshold)?)))
        };
        // SAFETY: promised by the caller.
        unsafe { border::give(oracle, "oracle", make) }
    })
}

/// Frees an oracle; sessions made from it do not need it. NULL is ignored.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_oracle_free(oracle: *mut NfOracle) {
    guard(|| {
        // SAFETY: promised by the caller.
        unsafe { border::take_back(oracle) };
        Ok(())
    });
}
