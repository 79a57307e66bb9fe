//! Who renders: the built-in path tracer, a renderer in another process, a stack of pictures, or a program.

#[cfg(feature = "adapters")]
mod adapters;

#[cfg(feature = "adapters")]
pub use adapters::{ADAPTERS, Adapter};

use crate::say::note;
use anyhow::{Context, bail};
use indicatif::ProgressBar;
use noisefloor::ProgressiveSource;
use noisefloor_image::StackSource;
use noisefloor_ptwne::{
    Estimator, Filter, Ptwne, ReferenceNoise, RenderOptions, SampleCounts, Sampling, scenes,
};
use noisefloor_scenefile::{LoadOptions, Loaded, group_warnings};
use std::ffi::{OsStr, OsString};
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Where neither the command nor the scene says: a Cornell box takes half a minute.
const DEFAULT_SCENE: &str = "cornell-box";
const DEFAULT_SIZE: (usize, usize) = (384, 384);
const DEFAULT_DEPTH: u32 = 65;

/// Who renders, and how: checked, ready to be opened.
#[derive(Clone, Debug)]
pub struct SourceJob {
    pub kind: SourceKind,
    /// As typed.
    pub scene: Option<OsString>,
    pub seed: u64,
    pub size: Option<(usize, usize)>,
    pub max_depth: Option<u32>,
    pub threads: Option<NonZeroUsize>,
    /// Of one call to another renderer.
    #[cfg_attr(not(feature = "adapters"), expect(dead_code, reason = "no other renderer is in this build"))]
    pub timeout: Duration,
    /// How the built-in renderer loads scene files.
    pub scene_files: LoadOptions,
}

#[derive(Clone, Debug)]
pub enum SourceKind {
    Ptwne(PtwneOptions),
    /// A folder of pictures.
    Exr,
    /// A template.
    #[cfg(feature = "adapters")]
    Command(String),
    #[cfg(feature = "adapters")]
    Adapter(&'static Adapter),
}

/// Options of the built-in renderer alone.
#[derive(Clone, Copy, Debug, Default)]
pub struct PtwneOptions {
    pub estimator: Estimator,
    pub sampling: Sampling,
    pub filter: Filter,
    pub clamp: Option<f32>,
}

impl SourceKind {
    /// As it is typed.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Ptwne(_) => "ptwne",
            Self::Exr => "exr",
            #[cfg(feature = "adapters")]
            Self::Command(_) => "command",
            #[cfg(feature = "adapters")]
            Self::Adapter(adapter) => adapter.name,
        }
    }

    /// Whether it renders at the size asked for; pictures have theirs.
    pub fn takes_size(&self) -> bool {
        !matches!(self, Self::Exr)
    }

    /// Whether it can be told the longest path.
    pub fn takes_depth(&self) -> bool {
        match self {
            Self::Ptwne(_) => true,
            Self::Exr => false,
            #[cfg(feature = "adapters")]
            Self::Command(_) => false,
            #[cfg(feature = "adapters")]
            Self::Adapter(_) => true,
        }
    }
}

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

impl Source for StackSource {}

/// A source that is ready to sample.
pub struct Opened {
    pub source: Box<dyn Source>,
    /// Name of the scene, of the output folder and in reports.
    pub scene: String,
    pub warnings: Vec<String>,
}

impl Opened {
    /// Says what the user should know before the run.
    pub fn warn(&self) {
        self.warnings.iter().for_each(|warning| note!("warning: {warning}"));
    }
}

impl SourceJob {
    /// Makes the pool of threads that was asked for.
    pub fn start_threads(&self) -> anyhow::Result<()> {
        if let Some(threads) = self.threads {
            rayon::ThreadPoolBuilder::new().num_threads(threads.get()).build_global().context("--threads")?;
        }
        Ok(())
    }

    /// Opens the source.
    pub fn open(&self) -> anyhow::Result<Opened> {
        match &self.kind {
            SourceKind::Ptwne(options) => self.open_ptwne(*options),
            SourceKind::Exr => {
                let folder = self.scene.as_deref().context("--source exr needs a folder of pictures")?;
                let source = Box::new(StackSource::open(folder)?);
                Ok(Opened { source, scene: stem(folder), warnings: Vec::new() })
            }
            #[cfg(feature = "adapters")]
            SourceKind::Command(template) => adapters::open_command(template, self),
            #[cfg(feature = "adapters")]
            SourceKind::Adapter(adapter) => adapters::open_adapter(adapter, self),
        }
    }

    fn open_ptwne(&self, options: PtwneOptions) -> anyhow::Result<Opened> {
        let Loaded { scene, size, max_depth, warnings } =
            load(self.scene.as_deref().unwrap_or(OsStr::new(DEFAULT_SCENE)), &self.scene_files)?;
        let (width, height) = self.size.or(size).unwrap_or(DEFAULT_SIZE);
        let name = scene.name().to_owned();
        let PtwneOptions { estimator, sampling, filter, clamp } = options;
        let options = RenderOptions {
            seed: self.seed,
            max_depth: self.max_depth.or(max_depth).unwrap_or(DEFAULT_DEPTH),
            estimator,
            sampling,
            filter,
            clamp,
            ..RenderOptions::default()
        };
        let source = Box::new(Ptwne::new(scene, width, height, options)?);
        let warnings = group_warnings(&warnings).iter().map(ToString::to_string).collect();
        Ok(Opened { source, scene: name, warnings })
    }
}

/// A built-in scene of that name, or the scene in that file.
fn load(scene: &OsStr, options: &LoadOptions) -> anyhow::Result<Loaded> {
    if let Some(scene) = scene.to_str().and_then(scenes::by_name) {
        return Ok(Loaded { scene, size: None, max_depth: None, warnings: vec![] });
    }
    let path = Path::new(scene);
    if path.extension().is_none() && !path.exists() {
        bail!(
            "there is no built-in scene {scene:?}, and no file of that name; `noisefloor scenes` lists the scenes"
        );
    }
    Ok(noisefloor_scenefile::load_with(path, options)?)
}

/// `hall` of `rooms/hall.xml`, and of `rooms/hall/`.
fn stem(path: &OsStr) -> String {
    let stem = Path::new(path).file_stem().map(|stem| stem.to_string_lossy().into_owned());
    stem.unwrap_or_else(|| "scene".to_owned())
}
