//! [Mitsuba 3](https://www.mitsuba-renderer.org) as a source of samples.
//!
//! ```no_run
//! let mut source = noisefloor_mitsuba::open(&noisefloor_sidecar::Job::new("hall/scene.xml"))?;
//! source.warnings().iter().for_each(|warning| eprintln!("{warning}"));
//! # Ok::<(), noisefloor_sidecar::SidecarError>(())
//! ```
//!
//! # What is rendered
//! The scene as its XML file says, but for a box filter, independent samples, and size and depth where the [`Job`] has them.
//! Integrators that sample single rays are used as they are (`path`, `volpath`, `volpathmis`, `direct`, and `aov` and the like around
//! them); others make way for `path`, with a warning. The first sensor is used.
//!
//! # Variants
//! - [`Variant::Llvm`]: one wavefront over the pixels of all tiles of a call. Each sample has a random stream of its own, which follows
//!   from (seed, pixel, index), so that the source repeats samples however requests are cut. Needs libLLVM 17 or newer:
//!   that of `DRJIT_LIBLLVM_PATH`, else the newest in the usual places. Mitsuba refuses version 14, and 15 and 16 abort it; where
//!   there is no better one, the scalar variant has to do, with a warning.
//! - [`Variant::Scalar`]: tile by tile, as crop windows. The source repeats calls. Mitsuba numbers streams with 32 bits here, a
//!   stream a pixel and call: after 2³² of them (16,384 batches of a picture of 512×512 pixels) streams come again, in other places.

mod llvm;

use llvm::Llvm;
use noisefloor_sidecar::{Adapter, Job, Renderer, Sidecar, SidecarError};

/// How Mitsuba is set up and found.
pub const RENDERER: Renderer = Renderer {
    name: "mitsuba",
    title: "Mitsuba 3.9.1",
    script: include_str!("../host/mitsuba_host.py"),
    requirements: include_str!("../requirements.txt"),
    pythons: &[12, 11, 13, 14],
    probe: "import mitsuba; print(mitsuba.__version__)",
};

/// A way in which Mitsuba computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// Opens a scene (Mitsuba XML) in the fastest variant that works.
///
/// # Errors
/// [`SidecarError`] if Mitsuba is not installed, or cannot load the scene.
pub fn open(job: &Job) -> Result<Sidecar, SidecarError> {
    open_as(job, Variant::Llvm)
}

/// Opens a scene in a variant; [`Variant::Llvm`] falls back to [`Variant::Scalar`] where it does not work.
///
/// # Errors
/// As [`open`].
pub fn open_as(job: &Job, variant: Variant) -> Result<Sidecar, SidecarError> {
    let mut adapter = Adapter::default();
    let variant = match (variant, llvm::find()) {
        (Variant::Llvm, Llvm::Usable(path)) => {
            adapter.env.push((llvm::VARIABLE.to_owned(), path.into()));
            Variant::Llvm
        }
        (Variant::Llvm, missing) => {
            adapter.warnings.extend(missing.note());
            Variant::Scalar
        }
        (Variant::Scalar, _) => Variant::Scalar,
    };
    adapter.options.insert("variant".to_owned(), variant.name().into());
    Sidecar::start(&RENDERER, job, adapter)
}

/// What keeps Mitsuba from being fast here, and what mends it; nothing if all is well.
pub fn notes() -> Vec<String> {
    llvm::find().note().into_iter().collect()
}
