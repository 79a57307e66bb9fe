//! What an adapter says of its renderer, and what a caller wants of it.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

/// Time for one call, if the caller has no other wish: half an hour. Renderers are slow; processes that hang are rare.
pub const DEFAULT_TIMEOUT: Duration = Duration::from_secs(1800);

/// What an adapter crate says of its renderer, as a constant.
#[derive(Clone, Copy, Debug)]
pub struct Renderer {
    /// Short name, of files and options: `"mitsuba"`. Lower-case ASCII letters.
    pub name: &'static str,
    /// Name for people, with the version that is installed: `"Mitsuba 3.9.1"`.
    pub title: &'static str,
    /// The host script (see `host/host.py`); its file is called `NAME_host.py`.
    pub script: &'static str,
    /// Pinned packages with hashes, as `pip install --require-hashes` takes them.
    pub requirements: &'static str,
    /// Minor versions of CPython 3 that those packages exist for, the best first: `&[12, 11]`.
    pub pythons: &'static [u8],
    /// Python statements that load the renderer and print its version.
    pub probe: &'static str,
}

impl Renderer {
    /// The environment variable that names an interpreter to use instead of the private one: `NOISEFLOOR_MITSUBA_PYTHON`.
    pub fn variable(&self) -> String {
        format!("NOISEFLOOR_{}_PYTHON", self.name.to_ascii_uppercase())
    }
}

/// What to render, and how: the same for every renderer.
#[derive(Clone, Debug)]
pub struct Job {
    /// The scene, in the renderer's own format.
    pub scene: PathBuf,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Width and height in pixels; the scene's own if `None`.
    pub size: Option<(usize, usize)>,
    /// Longest path, in segments: 1 is light seen directly, 2 is direct light; the scene's own if `None`.
    pub max_depth: Option<u32>,
    /// Threads; what the renderer thinks best if `None`.
    pub threads: Option<NonZeroUsize>,
    /// Time for one call, loading the scene included.
    pub timeout: Duration,
}

impl Job {
    /// A scene as it is, with seed 1 and [`DEFAULT_TIMEOUT`].
    pub fn new(scene: impl Into<PathBuf>) -> Self {
        let scene = scene.into();
        Self { scene, seed: 1, size: None, max_depth: None, threads: None, timeout: DEFAULT_TIMEOUT }
    }
}
