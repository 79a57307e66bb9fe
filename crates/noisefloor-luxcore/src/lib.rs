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
//! The scene as its configuration (`.cfg`) says, or a scene (`.scn`) with LuxCore's own settings, but for: no filter, no clamping, no
//! adaptive sampling, no photon caches, nothing that stops early; and size and depth where the [`Job`] has them. Files that a scene
//! names are relative to it. Pictures lie one row of pixels lower than those of other renderers, as LuxCore's do.
//!
//! # Samples
//! Nothing repeats: LuxCore's threads race for pixels. They also stop a little late; what is drawn beyond the number asked for is
//! taken off the tile's next batch, so that counts are as asked, and right in the long run.
//!
//! - [`Sampler::Random`], [`Sampler::Sobol`]: a fresh session of LuxCore, with a fresh seed, for every rectangle of tiles of a call. Batches
//!   are independent. A session starts in some milliseconds, and then has to build the tree over the scene's triangles, about a
//!   second for a million of them. Sobol points would have less noise in larger batches: sessions have eight of them, so
//!   that a batch of any size has the noise of as many sessions.
//! - [`Sampler::Metropolis`]: a Markov chain must not be cut. Two chains live in every tile, paused in between, and take turns; noisefloor
//!   keeps one in each half of its film. The unit of work is mutations a pixel. Each chain holds a scene of its own: memory
//!   grows with tiles × scene, beside 0.4 MB a chain. Perspective and orthographic cameras only. Of a chain, one batch knows of
//!   the one before; between chains nothing is shared. Noise is correlated between neighbouring pixels.
//! - [`Engine::Bidir`] without Russian roulette, which LuxCore's weights leave out: with it, pictures are several per cent too bright.
//!   Depth limits the two ends of a path, and not its length.

use noisefloor_sidecar::{Adapter, Job, Renderer, Sidecar, SidecarError};

/// How LuxCore is set up and found.
pub const RENDERER: Renderer = Renderer {
    name: "luxcore",
    title: "LuxCore 2.11.2",
    script: include_str!("../host/luxcore_host.py"),
    requirements: include_str!("../requirements.txt"),
    pythons: &[12, 11, 13, 14],
    // Ends at once: tearing LuxCore down may abort Python
    probe: "import os, numpy, pyluxcore; pyluxcore.Init(); print(pyluxcore.Version(), flush=True); os._exit(0)",
};

/// What traces paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
pub enum Sampler {
    /// Each sample on its own.
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
    let mut adapter = Adapter::default();
    adapter.options.insert("engine".to_owned(), engine.name().into());
    adapter.options.insert("sampler".to_owned(), sampler.name().into());
    Sidecar::start(&RENDERER, job, adapter)
}
