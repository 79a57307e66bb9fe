//! Renderers in another process.

use super::{Opened, Resources, Source, SourceJob, stem};
use anyhow::Context;
use noisefloor::{Schedule, Tile};
use noisefloor_luxcore::{Engine, Sampler};
use noisefloor_sidecar::{
    AdaptivePicture, CommandOptions, CommandSource, Job, Renderer, Sidecar, SidecarError,
};
use std::fmt;
use std::str::FromStr;

/// A renderer in another process, as its crate offers it.
pub struct Adapter {
    /// What `--source` calls it.
    pub name: &'static str,
    pub renderer: &'static Renderer,
    open: fn(&Job) -> Result<Sidecar, SidecarError>,
    /// Samples per pixel between verdicts, at the least.
    pub step: u64,
    /// The coarsest of its own noise thresholds that is worth trying; none if it does not sample where noise is above one.
    pub threshold: Option<f64>,
    /// Whether it renders a part of such a picture as it is in the whole.
    pub crops: bool,
    /// Whether one of its scene files holds all frames of a film.
    pub frames: bool,
    /// What keeps it from being all it could be here, and what mends that.
    pub notes: fn() -> Vec<String>,
}

/// All of them. One more is one entry here.
pub const ADAPTERS: &[Adapter] = &[
    Adapter {
        name: "mitsuba",
        renderer: &noisefloor_mitsuba::RENDERER,
        open: noisefloor_mitsuba::open,
        step: Schedule::STEP,
        threshold: None,
        crops: false,
        frames: false,
        notes: noisefloor_mitsuba::notes,
    },
    luxcore("luxcore", |job| noisefloor_luxcore::open(job, Engine::Path, Sampler::Random)),
    // Sobol points in blocks of 8
    Adapter {
        step: 16,
        ..luxcore("luxcore-sobol", |job| noisefloor_luxcore::open(job, Engine::Path, Sampler::Sobol))
    },
    // A chain has no pixels of its own
    Adapter {
        threshold: None,
        crops: false,
        ..luxcore("luxcore-metropolis", |job| {
            noisefloor_luxcore::open(job, Engine::Path, Sampler::Metropolis)
        })
    },
    luxcore("luxcore-bidir", |job| noisefloor_luxcore::open(job, Engine::Bidir, Sampler::Random)),
    Adapter {
        name: "cycles",
        renderer: &noisefloor_cycles::RENDERER,
        open: noisefloor_cycles::open,
        // Each call costs it a start
        step: 32,
        threshold: Some(0.2),
        crops: true,
        frames: true,
        notes: Vec::new,
    },
];

const fn luxcore(name: &'static str, open: fn(&Job) -> Result<Sidecar, SidecarError>) -> Adapter {
    let (renderer, step) = (&noisefloor_luxcore::RENDERER, Schedule::STEP);
    // Its own default, 10/256: coarser ones stop at its first looks, whose number depends on how busy the machine is
    let threshold = Some(0.04);
    Adapter { name, renderer, open, step, threshold, crops: false, frames: false, notes: Vec::new }
}

/// An adapter by its name: its functions have other addresses in every run.
impl fmt::Debug for Adapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl PartialEq for Adapter {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl fmt::Display for &'static Adapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl FromStr for &'static Adapter {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = || ADAPTERS.iter().map(|adapter| adapter.name).collect::<Vec<_>>().join(", ");
        // What people call the program that they have
        let name = if text == "blender" { "cycles" } else { text };
        let found = ADAPTERS.iter().find(|adapter| adapter.name == name);
        found.ok_or_else(|| format!("the other renderers are: {}", names()))
    }
}

impl Source for Sidecar {
    fn adaptive(
        &mut self,
        threshold: f64,
        most: Option<u64>,
        seed: u32,
        part: Option<Tile>,
    ) -> anyhow::Result<Option<AdaptivePicture>> {
        Ok(Sidecar::adaptive(self, threshold, most, seed, part)?)
    }

    fn notes(&self) -> Vec<String> {
        let note = |error| format!("the renderer was started again: {error}").replace('\n', " ");
        self.restarts().iter().map(note).collect()
    }
}

impl Source for CommandSource {}

pub(super) fn open_adapter(
    adapter: &Adapter,
    job: &SourceJob,
    resources: Resources,
) -> anyhow::Result<Opened> {
    let scene = job.scene();
    let scene = scene.with_context(|| format!("--source {} needs a scene file", adapter.name))?;
    let mut sidecar = Job::new(scene);
    (sidecar.seed, sidecar.size, sidecar.max_depth) = (job.seed, job.size, job.max_depth);
    (sidecar.threads, sidecar.timeout) = (resources.threads, resources.timeout);
    (sidecar.frame, sidecar.device) = (job.frame, job.device.clone());
    let source = (adapter.open)(&sidecar)?;
    let warnings = source.warnings().to_vec();
    Ok(Opened { source: Box::new(source), scene: stem(scene), warnings })
}

pub(super) fn open_command(template: &str, job: &SourceJob, resources: Resources) -> anyhow::Result<Opened> {
    let mut options = CommandOptions::default();
    (options.scene, options.seed) = (job.scene().map(Into::into), job.seed);
    (options.size, options.timeout) = (job.size, resources.timeout);
    let source = Box::new(CommandSource::new(template, options)?);
    let scene = job.scene().map_or_else(|| "command".to_owned(), stem);
    Ok(Opened { source, scene, warnings: Vec::new() })
}
