//! Who renders: the built-in path tracer, a renderer in another process, a stack of pictures, or a command.

use crate::args::{FilterChoice, RendererArgs, SamplerChoice, SourceChoice};
use anyhow::{Context, bail};
use indicatif::ProgressBar;
use noisefloor::ProgressiveSource;
use noisefloor_image::StackSource;
use noisefloor_luxcore::{Engine, Sampler};
use noisefloor_ptwne::{
    Estimator, Filter, Ptwne, ReferenceNoise, RenderOptions, SampleCounts, Sampling, scenes,
};
use noisefloor_scenefile::Loaded;
use noisefloor_sidecar::{CommandOptions, CommandSource, Job, Renderer, Sidecar, SidecarError};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A renderer in another process, as its crate offers it.
#[derive(Debug)]
pub struct Adapter {
    /// What `--source` calls it.
    pub name: &'static str,
    pub renderer: &'static Renderer,
    pub open: fn(&Job) -> Result<Sidecar, SidecarError>,
    /// What keeps it from being all it could be here, and what mends that.
    pub notes: fn() -> Vec<String>,
}

/// All of them. One more is one entry here.
pub const ADAPTERS: &[Adapter] = &[
    Adapter {
        name: "mitsuba",
        renderer: &noisefloor_mitsuba::RENDERER,
        open: noisefloor_mitsuba::open,
        notes: noisefloor_mitsuba::notes,
    },
    luxcore("luxcore", |job| noisefloor_luxcore::open(job, Engine::Path, Sampler::Random)),
    luxcore("luxcore-sobol", |job| noisefloor_luxcore::open(job, Engine::Path, Sampler::Sobol)),
    luxcore("luxcore-metropolis", |job| noisefloor_luxcore::open(job, Engine::Path, Sampler::Metropolis)),
    luxcore("luxcore-bidir", |job| noisefloor_luxcore::open(job, Engine::Bidir, Sampler::Random)),
    Adapter {
        name: "cycles",
        renderer: &noisefloor_cycles::RENDERER,
        open: noisefloor_cycles::open,
        notes: Vec::new,
    },
];

const fn luxcore(name: &'static str, open: fn(&Job) -> Result<Sidecar, SidecarError>) -> Adapter {
    Adapter { name, renderer: &noisefloor_luxcore::RENDERER, open, notes: Vec::new }
}

/// Where neither the command nor the scene says: a Cornell box takes half a minute.
const DEFAULT_SCENE: &str = "cornell-box";
const DEFAULT_SIZE: (usize, usize) = (384, 384);
const DEFAULT_DEPTH: u32 = 65;

/// What the command asks of a source beside samples.
pub trait Source: ProgressiveSource {
    /// What became of the samples, where the source counts it.
    fn counts(&self) -> Option<SampleCounts> {
        None
    }

    /// Shows how far a reference is, where it takes long, and gives it up once `cancel` is set.
    fn watch_reference(&mut self, _bar: ProgressBar, _cancel: Arc<AtomicBool>) {}

    /// What noise its reference was left with, where it has rendered one and can tell.
    fn reference_noise(&self) -> Option<&ReferenceNoise> {
        None
    }

    /// What the user should know after the run.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}

impl Source for Ptwne {
    fn counts(&self) -> Option<SampleCounts> {
        Some(Ptwne::counts(self))
    }

    fn watch_reference(&mut self, bar: ProgressBar, cancel: Arc<AtomicBool>) {
        Ptwne::watch_reference(self, move |done, all| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
            if done == all {
                bar.finish_and_clear();
            }
            if cancel.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
    }

    fn reference_noise(&self) -> Option<&ReferenceNoise> {
        Ptwne::reference_noise(self)
    }
}

impl Source for Sidecar {
    fn notes(&self) -> Vec<String> {
        let note = |error| format!("it was started again: {error}").replace('\n', " ");
        self.restarts().iter().map(note).collect()
    }
}

impl Source for StackSource {}

impl Source for CommandSource {}

/// A source that is ready to sample.
pub struct Opened {
    pub source: Box<dyn Source>,
    /// Name of the scene, of the output folder and in reports.
    pub scene: String,
    pub warnings: Vec<String>,
}

/// Opens what `--source` and the scene say.
pub fn open(scene: Option<&str>, args: &RendererArgs) -> anyhow::Result<Opened> {
    let (source, scene, warnings): (Box<dyn Source>, _, _) = match &args.source {
        SourceChoice::Ptwne => return ptwne(args, scene.unwrap_or(DEFAULT_SCENE)),
        SourceChoice::Adapter(adapter) => {
            let name = adapter.name;
            only_ptwne(args, name, &[])?;
            let scene = scene.with_context(|| format!("--source {name} needs a scene file"))?;
            let mut job = Job::new(scene);
            (job.seed, job.size, job.max_depth) = (args.seed, args.size, args.max_depth);
            (job.threads, job.timeout) = (args.threads, args.timeout);
            let sidecar = (adapter.open)(&job)?;
            let warnings = sidecar.warnings().to_vec();
            (Box::new(sidecar), stem(scene), warnings)
        }
        SourceChoice::Exr => {
            let given = [("--size", args.size.is_some()), ("--max-depth", args.max_depth.is_some())];
            only_ptwne(args, "exr", &given)?;
            let folder = scene.context("--source exr needs a folder of pictures")?;
            (Box::new(StackSource::open(folder)?), stem(folder), Vec::new())
        }
        SourceChoice::Command(template) => {
            only_ptwne(args, "command", &[("--max-depth", args.max_depth.is_some())])?;
            let mut options = CommandOptions::default();
            (options.scene, options.seed) = (scene.map(Into::into), args.seed);
            (options.size, options.timeout) = (args.size, args.timeout);
            let source = CommandSource::new(template, options)?;
            (Box::new(source), scene.map_or_else(|| "command".to_owned(), stem), Vec::new())
        }
    };
    Ok(Opened { source, scene, warnings })
}

/// Refuses options that another source than the built-in renderer has not; `more` are others, and whether they are given.
fn only_ptwne(args: &RendererArgs, source: &str, more: &[(&str, bool)]) -> anyhow::Result<()> {
    let given = [
        ("--no-mis", args.no_mis),
        ("--sampler", args.sampler.is_some()),
        ("--filter", args.filter.is_some()),
        ("--clamp", args.clamp.is_some()),
    ];
    if let Some((option, _)) = given.iter().chain(more).find(|(_, given)| *given) {
        bail!("{option} is not an option of --source {source}; leave it out");
    }
    Ok(())
}

fn ptwne(args: &RendererArgs, scene: &str) -> anyhow::Result<Opened> {
    let Loaded { scene, size, max_depth, warnings } = load(scene)?;
    let (width, height) = args.size.or(size).unwrap_or(DEFAULT_SIZE);
    let name = scene.name().to_owned();
    let options = RenderOptions {
        seed: args.seed,
        max_depth: args.max_depth.or(max_depth).unwrap_or(DEFAULT_DEPTH),
        estimator: if args.no_mis { Estimator::NextEvents } else { Estimator::Mis },
        sampling: match args.sampler {
            None | Some(SamplerChoice::Independent) => Sampling::Independent,
            Some(SamplerChoice::Sobol) => Sampling::Sobol,
        },
        filter: match args.filter {
            None | Some(FilterChoice::Box) => Filter::Box,
            Some(FilterChoice::Tent) => Filter::Tent,
            Some(FilterChoice::Gaussian) => Filter::Gaussian,
        },
        clamp: args.clamp,
        ..RenderOptions::default()
    };
    let source = Box::new(Ptwne::new(scene, width, height, options)?);
    let warnings = warnings.iter().map(ToString::to_string).collect();
    Ok(Opened { source, scene: name, warnings })
}

/// A built-in scene of that name, or the scene in that file.
fn load(scene: &str) -> anyhow::Result<Loaded> {
    if let Some(scene) = scenes::by_name(scene) {
        return Ok(Loaded { scene, size: None, max_depth: None, warnings: vec![] });
    }
    let path = Path::new(scene);
    if path.extension().is_none() && !path.exists() {
        bail!(
            "there is no built-in scene {scene:?}, nor a file of that name; `noisefloor scenes` lists the built-in ones"
        );
    }
    Ok(noisefloor_scenefile::load(path)?)
}

/// `hall` of `rooms/hall.xml`, and of `rooms/hall/`.
fn stem(path: &str) -> String {
    let stem = Path::new(path).file_stem().map(|stem| stem.to_string_lossy().into_owned());
    stem.unwrap_or_else(|| "scene".to_owned())
}
