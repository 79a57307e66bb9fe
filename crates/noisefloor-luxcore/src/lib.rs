//! [LuxCore](https://luxcorerender.org) as a source of samples.
//!
//! ```no_run
//! use noisefloor_luxcore::{Engine, Sampler};
//!
//! let job = noisefloor_sidecar::Job::new("hall/render.cfg");
//! let mut source = noisefloor_luxcore::open(&job, Engine::Path, Sampler::Metropolis)?;
//! source.warnings().iter().for_each(|warning| eprintln!("{warning}"));
//! # Ok::<(), noisefloor_sidecar::SidecarError>(())
//! ```
//!
//! # What is rendered
//! The scene as its configuration (`.cfg`) describes it, or a scene (`.scn`) with LuxCore's own settings; in
//! either case without filter, clamping, adaptive sampling, photon caches and early stops, and with size and
//! depth from the [`Job`] if given. Names in a configuration begin at the working
//! directory, as for LuxCore, or at the folder of the configuration or one above it, wherever the scene is. Pictures lie one row of
//! pixels lower than those of other renderers: that is LuxCore's way.
//!
//! # Samples
//! Nothing repeats: LuxCore's threads race for pixels. They also stop a little late. Samples beyond the
//! requested number are deducted from the tile's next batch, so that counts are as requested, and right in
//! the long run.
//!
//! - [`Sampler::Random`], [`Sampler::Sobol`]: a fresh session of LuxCore, with a fresh seed, for every
//!   rectangle of tiles of a call. Batches are independent. A session starts within milliseconds, and then
//!   has to build the tree over the scene's triangles, about a second for a million. Sobol points would have
//!   less noise in larger batches; sessions therefore have eight of them, so that a batch of any size has the
//!   noise of several sessions.
//! - [`Sampler::Metropolis`]: a Markov chain must not be cut. Two chains live in every tile, paused between
//!   batches, and take turns; noisefloor keeps one in each half of its film. The unit of work is mutations
//!   per pixel. Each chain holds its own scene: memory grows with tiles × scene, plus 0.4 MB per chain. Only
//!   perspective and orthographic cameras. Successive batches of a chain are correlated; the two chains share
//!   nothing. Noise is correlated between neighbouring pixels.
//! - [`Engine::Bidir`] runs without Russian roulette, which LuxCore's weights do not account for: with it,
//!   pictures are several per cent too bright. Depth limits both ends of a path, not its length.

use noisefloor_sidecar::{HostOptions, Job, Renderer, Sidecar, SidecarError};

/// How LuxCore is installed and found.
pub const RENDERER: Renderer = Renderer {
    name: "luxcore",
    title: "LuxCore 2.11.2",
    script: include_str!("../host/luxcore_host.py"),
    requirements: include_str!("../requirements.txt"),
    pythons: &[12, 11, 13, 14],
    // Ends at once: tearing LuxCore down may abort Python
    probe: "import os, numpy, pyluxcore; pyluxcore.Init(); \
            print(pyluxcore.Version(), flush=True); os._exit(0)",
};

/// What traces paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Engine {
    /// From the camera, with next event estimation: LuxCore's `PATHCPU`.
    Path,
    /// From both ends: LuxCore's `BIDIRCPU`.
    Bidir,
}

impl Engine {
    fn name(self) -> &'static str {
        match self {
            Self::Path => "path",
            Self::Bidir => "bidir",
        }
    }
}

/// What chooses paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Sampler {
    /// Independent samples.
    Random,
    /// Scrambled Sobol points.
    Sobol,
    /// Metropolis light transport in primary sample space.
    Metropolis,
}

impl Sampler {
    fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Sobol => "sobol",
            Self::Metropolis => "metropolis",
        }
    }
}

/// Opens a scene (`.cfg` or `.scn`).
///
/// # Errors
/// [`SidecarError`] if LuxCore is not installed, or cannot load the scene.
pub fn open(job: &Job, engine: Engine, sampler: Sampler) -> Result<Sidecar, SidecarError> {
    let mut options = HostOptions::default();
    options.options.insert("engine".to_owned(), engine.name().into());
    options.options.insert("sampler".to_owned(), sampler.name().into());
    Sidecar::start(&RENDERER, job, options)
}
