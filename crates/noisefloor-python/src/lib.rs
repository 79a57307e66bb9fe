//! noisefloor for Python: the module `noisefloor._noisefloor`, which `python/noisefloor/__init__.py`
//! re-exports.
//!
//! - `errors.rs`: one exception for each kind of error;
//! - `arrays.rs`: between numpy and slices;
//! - `params.rs`, `oracle.rs`, `verdicts.rs`, `session.rs`: the push session;
//! - `background.rs`: a session that judges beside the rendering;
//! - `check.rs`: the contract of a renderer;
//! - `eyes.rs`: what `noisefloor calibrate` has measured;
//! - `files.rs`, `stills.rs`, `metrics.rs`: finished pictures;
//! - `tone.rs`, `tune.rs`: how pictures are shown, and the search for a renderer's own setting;
//! - `pickle.rs`: how objects go to other processes;
//! - `pool.rs`: threads that survive a fork.
//!
//! What takes long runs without the interpreter's lock. Its types never change, or stand behind a lock of
//! their own.

mod arrays;
mod background;
mod check;
mod errors;
mod eyes;
mod files;
mod judging;
mod metrics;
mod oracle;
mod params;
mod pickle;
mod pool;
mod session;
mod stills;
mod tone;
mod tune;
mod verdicts;

use pyo3::prelude::*;

#[pymodule]
mod _noisefloor {
    #[pymodule_export]
    use crate::background::PyBackground;
    #[pymodule_export]
    use crate::check::check;
    #[pymodule_export]
    use crate::errors::{
        BatchError, CheckpointError, CriterionError, Error, FaultError, ModelError, ParameterError,
        PictureError, SizeError,
    };
    #[pymodule_export]
    use crate::eyes::{PyEyes, eyes};
    #[pymodule_export]
    use crate::files::{read, write};
    #[pymodule_export]
    use crate::judging::{first_hits_are_clean, mirror_mean};
    #[pymodule_export]
    use crate::metrics::{PyMetrics, metrics};
    #[pymodule_export]
    use crate::oracle::PyOracle;
    #[pymodule_export]
    use crate::params::{PyParams, PyViewing};
    #[pymodule_export]
    use crate::session::PySession;
    #[pymodule_export]
    use crate::stills::{PyJudged, judge};
    #[pymodule_export]
    use crate::tone::{PyLut, PyToneTable};
    #[pymodule_export]
    use crate::tune::{PyExcess, PyLook, PySearch, excess};
    #[pymodule_export]
    use crate::verdicts::{PyRequest, PyStop, PyTile, PyVerdict};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let stop = wrap_pyfunction!(crate::background::stop_all, module)?;
        module.py().import("atexit")?.call_method1("register", (stop,))?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
