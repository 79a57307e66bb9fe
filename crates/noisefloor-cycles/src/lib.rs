//! [Cycles](https://www.cycles-renderer.org), Blender's path tracer, as a source of samples.
//!
//! ```no_run
//! let mut source = noisefloor_cycles::open(&noisefloor_sidecar::Job::new("hall.blend"))?;
//! source.warnings().iter().for_each(|warning| eprintln!("{warning}"));
//! # Ok::<(), noisefloor_sidecar::SidecarError>(())
//! ```
//!
//! # What is rendered
//! The scene as its `.blend` file describes it, with the camera, frame and view layers that were active when
//! it was saved, or at the frame of the [`Job`]; with a box filter of one pixel; without clamping of samples, light threshold, adaptive
//! sampling, denoising, path guiding, compositing and sequencer; and with size and depth from the [`Job`] if
//! given. Scripts in the file are not run. Radiance is linear; exposure is applied, the view transform is
//! not.
//!
//! A scene can also be a `.py` file, which is run in Blender and builds it. Only run files of people you
//! trust.
//!
//! # Samples
//! On the processor, the source repeats samples, however requests are cut; on a GPU, nothing. Each
//! `Request::sequence` is a pattern of Cycles' own Sobol table with its own seed, and another after 8,192 samples: halves are hardly correlated (−0.04 in the
//! Cornell box), and the batches of one half fill each other's gaps. Cycles renders one rectangle of tiles at a
//! time, at a cost of 5 ms beside the samples.
//!
//! Albedo and normals (`first_hits`) are those that Cycles gives its own
//! denoisers: where a mirror or glass is hit first, they are of what is seen in it.
//!
//! Noise decreases faster with the number of samples than that of independent ones.

use noisefloor_sidecar::{HostOptions, Job, Renderer, Sidecar, SidecarError};

/// How Cycles is installed and found.
pub const RENDERER: Renderer = Renderer {
    name: "cycles",
    title: "Cycles 5.0.1",
    // One file: the host needs no more modules than those of other renderers
    script: concat!(
        include_str!("../addon/noisefloor_addon/sampling.py"),
        "\n\n",
        include_str!("../host/cycles_host.py")
    ),
    requirements: include_str!("../requirements.txt"),
    pythons: &[11],
    probe: "import bpy; print(bpy.app.version_string)",
};

/// Opens a scene: a `.blend` file, or a `.py` file that builds one.
///
/// # Errors
/// [`SidecarError`] if Cycles is not installed, or cannot load the scene.
pub fn open(job: &Job) -> Result<Sidecar, SidecarError> {
    Sidecar::start(&RENDERER, job, HostOptions::default())
}
