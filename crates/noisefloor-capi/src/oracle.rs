//! Oracles.

use crate::border;
use crate::handle;
use crate::status::{Failure, NfStatus, guard};
use noisefloor::{Model, Oracle, People, model::ModelError};
use std::ffi::c_char;
use std::fs::File;
use std::io;

/// A trained model with the share of people who are to see no noise. It never changes, and any
/// number of sessions can be made from it.
pub struct NfOracle(pub(crate) Oracle);

impl handle::Handle for NfOracle {
    const NAME: &str = "oracle";
}

/// Makes an oracle from the model inside the library, which was trained on human data and judges by half
/// buffers. people, between 0 and 1, is the share of people who are to see no noise where a tile stops, in a
/// scene like those that people were asked about: 0.95 is that of the paper, and the default of all other
/// languages. The caller frees the oracle with nf_oracle_free.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_oracle_bundled(people: f32, oracle: *mut *mut NfOracle) -> NfStatus {
    guard(|| {
        let make = || Ok(NfOracle(Oracle::new(Model::bundled(), People::new(people)?)));
        // SAFETY: promised by the caller.
        unsafe { handle::give(oracle, make) }
    })
}

/// As nf_oracle_bundled, with a model that "noisefloor-lab train" has written to a file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_oracle_load(
    path: *const c_char,
    people: f32,
    oracle: *mut *mut NfOracle,
) -> NfStatus {
    guard(|| {
        // SAFETY: promised by the caller.
        let path = unsafe { border::text(path, "path") }?;
        let make = || {
            let failed = |error: io::Error| Failure::new(NfStatus::Io, format!("{path}: {error}"));
            let model = Model::read(File::open(path).map_err(failed)?).map_err(|error| match error {
                ModelError::Io(error) => failed(error), // also a folder, which can be opened
                other => other.into(),
            })?;
            Ok(NfOracle(Oracle::new(model, People::new(people)?)))
        };
        // SAFETY: promised by the caller.
        unsafe { handle::give(oracle, make) }
    })
}

/// Frees an oracle; sessions made from it do not need it. NULL is ignored, a second time is
/// NF_STATUS_HANDLE.
#[unsafe(no_mangle)]
pub extern "C" fn nf_oracle_free(oracle: *mut NfOracle) -> NfStatus {
    guard(|| handle::free(oracle))
}
