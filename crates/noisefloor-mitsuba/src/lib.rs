//! [Mitsuba 3](https://www.mitsuba-renderer.org) as a source of samples.
//!
//! ```no_run
//! let mut source = noisefloor_mitsuba::open(&noisefloor_sidecar::Job::new("hall/scene.xml"))?;
//! source.warnings().iter().for_each(|warning| eprintln!("{warning}"));
//! # Ok::<(), noisefloor_sidecar::SidecarError>(())
//! ```
//!
//! # What is rendered
//! The scene as its XML file describes it, with a box filter, and size and depth from
//! the [`Job`] if given. Integrators that sample single rays are used as they are (`path`, `volpath`,
//! `volpathmis`, `direct`, also inside `aov` and the like); others are replaced by `path`, with a warning.
//! The first sensor is used.
//!
//! # Variants
//! - [`Variant::Llvm`]: one wavefront over the pixels of all tiles of a call. Samples are Owen-scrambled
//!   Sobol points of the request's sequence, which depend only on seed, pixel, sequence and place in it: they
//!   repeat however requests are cut. Needs
//!   libLLVM 17 or newer, from `DRJIT_LIBLLVM_PATH` or else the newest in the usual places. Mitsuba refuses
//!   version 14, and versions 15 and 16 crash it; without a newer one the scalar variant is used, with a
//!   warning.
//! - `cuda_ad_rgb` takes the place of both where [`Job::device`] is a GPU: samples as with [`Variant::Llvm`], on NVIDIA's
//!   cards, by OptiX. Two renders are the same to the bit there (one H200, 2026-11-27).
//! - [`Variant::Scalar`]: tile by tile, as crop windows, with independent samples. The source repeats calls. Mitsuba numbers streams
//!   with 32 bits here, one per pixel and call: after 2³² of them (16,384 batches of a picture of 512×512
//!   pixels) streams recur, in other places.

mod llvm;

use llvm::Llvm;
use noisefloor_sidecar::{HostOptions, Job, Renderer, Sidecar, SidecarError};

/// How Mitsuba is installed and found.
pub const RENDERER: Renderer = Renderer {
    name: "mitsuba",
    title: "Mitsuba 3.9.1",
    script: include_str!("../host/mitsuba_host.py"),
    requirements: include_str!("../requirements.txt"),
    pythons: &[12, 11, 13, 14],
    probe: "import mitsuba; print(mitsuba.__version__)",
};

/// How Mitsuba computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Variant {
    /// `llvm_ad_rgb`: vectorised, compiled for the scene.
    Llvm,
    /// `scalar_rgb`: one ray at a time.
    Scalar,
}

impl Variant {
    fn name(self) -> &'static str {
        match self {
            Self::Llvm => "llvm_ad_rgb",
            Self::Scalar => "scalar_rgb",
        }
    }
}

/// Opens a scene (Mitsuba XML) in the fastest available variant.
///
/// # Errors
/// [`SidecarError`] if Mitsuba is not installed, or cannot load the scene.
pub fn open(job: &Job) -> Result<Sidecar, SidecarError> {
    open_as(job, Variant::Llvm)
}

/// Opens a scene in a variant; [`Variant::Llvm`] falls back to [`Variant::Scalar`], with a warning.
///
/// # Errors
/// As [`open`].
pub fn open_as(job: &Job, variant: Variant) -> Result<Sidecar, SidecarError> {
    let mut options = HostOptions::default();
    let variant = match (variant, llvm::find()) {
        (Variant::Llvm, Llvm::Usable(path)) => {
            options.env.push((llvm::VARIABLE.to_owned(), path.into()));
            Variant::Llvm
        }
        (Variant::Llvm, missing) => {
            options.warnings.extend(missing.note());
            Variant::Scalar
        }
        (Variant::Scalar, _) => Variant::Scalar,
    };
    options.options.insert("variant".to_owned(), variant.name().into());
    Sidecar::start(&RENDERER, job, options)
}

/// What keeps Mitsuba from being fast on this machine, and how to fix it; empty if nothing does.
pub fn notes() -> Vec<String> {
    llvm::find().note().into_iter().collect()
}
