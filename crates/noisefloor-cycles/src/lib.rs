//! [Cycles](https://www.cycles-renderer.org), Blender's path tracer, as a source of samples.
//!
//! ```no_run
//! let mut source = noisefloor_cycles::open(&noisefloor_sidecar::Job::new("hall.blend"))?;
//! source.warnings().iter().for_each(|warning| eprintln!("{warning}"));
//! # Ok::<(), noisefloor_sidecar::SidecarError>(())
//! ```
//!
//! # What is rendered
//! The scene as its `.blend` file says, with the camera, frame and view layers that were active when it was saved, but for: a box
//! filter of one pixel; no clamping of samples, no light threshold, no adaptive sampling, denoising, path guiding, compositing or
//! sequence; and size and depth where the [`Job`] has them. Scripts in the file are not run. Radiance is linear, exposure included,
//! view transform not.
//!
//! A scene may also be a `.py` file, which is run in Blender and builds it. Run those of people you trust alone.
//!
//! # Samples
//! The source repeats samples, however requests are cut. They come in blocks of 16 points of Cycles' own Sobol table, each with a
//! seed of its own: batches of whole blocks are independent. Of batches that are not multiples of 16, each shares a block with
//! the one before, whose parts fill each other's gaps: halves made of them differ a little more than they should, and at edges of
//! lamps much more. Cycles renders a block of a rectangle of tiles at a time, which costs some 5 ms beside the samples.
//!
//! In nearly all pixels noise falls with the number of samples as that of independent ones does. At edges of lamps it falls
//! faster inside a block.

use noisefloor_sidecar::{Adapter, Job, Renderer, Sidecar, SidecarError};

/// How Cycles is set up and found.
pub const RENDERER: Renderer = Renderer {
    name: "cycles",
    title: "Cycles 5.0.1",
    script: include_str!("../host/cycles_host.py"),
    requirements: include_str!("../requirements.txt"),
    pythons: &[11],
    probe: "import bpy; print(bpy.app.version_string)",
};

/// Opens a scene: a `.blend` file, or a `.py` file that builds one.
///
/// # Errors
/// [`SidecarError`] if Cycles is not installed, or cannot load the scene.
pub fn open(job: &Job) -> Result<Sidecar, SidecarError> {
    Sidecar::start(&RENDERER, job, Adapter::default())
}
