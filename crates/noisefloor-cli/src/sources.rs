//! Who renders: the built-in path tracer, a renderer in another process, a stack of pictures, or a program.

mod adapters;

pub use adapters::{ADAPTERS, Adapter};

use crate::build::program_digest;
use crate::end::Usage;
use crate::refuse;
use crate::say::note;
use crate::spell::{JobPath, as_typed, with_frame};
use anyhow::{Context, bail};
use indicatif::ProgressBar;
use noisefloor::{
    Film, ProgressiveSource, Schedule, SourceError, Tile, source::Reference, stills::SampleOrigin,
};
use noisefloor_image::StackSource;
use noisefloor_ptwne::{
    Estimator, Filter, Ptwne, ReferenceNoise, RenderOptions, SampleCounts, Sampling, scenes,
};
use noisefloor_scenefile::{LoadFault, LoadOptions, Loaded, group_warnings};
use noisefloor_sidecar::{AdaptivePicture, Device};
use serde::{Deserialize, Serialize};
use std::ffi::OsStr;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use strsim::levenshtein;

/// Where neither the command nor the scene says: a Cornell box takes half a minute.
const DEFAULT_SCENE: &str = "cornell-box";
const DEFAULT_SIZE: (usize, usize) = (384, 384);
const DEFAULT_DEPTH: u32 = 65;

/// Who renders what: all that samples depend on, as a value. Checked; [`SourceJob::open`] finds out the
/// rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SourceJob {
    pub kind: SourceKind,
    /// A built-in scene, or a file or folder; {frame} stands for the frame of a sequence.
    pub scene: Option<JobPath>,
    pub seed: u64,
    /// Of a sequence: whether all frames have that seed.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub same_seed: bool,
    /// Of a scene file that holds all frames: which one is rendered.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<i32>,
    pub size: Option<(usize, usize)>,
    pub max_depth: Option<u32>,
    /// What another renderer computes on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<Device>,
    /// How the built-in renderer loads scene files.
    pub scene_files: LoadOptions,
}

/// What a source may use; samples do not depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Resources {
    pub threads: Option<NonZeroUsize>,
    /// Of one call to another renderer.
    pub timeout: Duration,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SourceKind {
    Ptwne(PtwneOptions),
    /// A folder of pictures.
    Exr,
    Command(String),
    Adapter(#[serde(with = "as_typed")] &'static Adapter),
}

/// Options of the built-in renderer alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PtwneOptions {
    pub estimator: Estimator,
    pub sampling: Sampling,
    pub filter: Filter,
    pub clamp: Option<f32>,
}

impl SourceKind {
    /// Samples per pixel between two verdicts, at the least.
    pub fn step(&self) -> u64 {
        match self {
            Self::Adapter(adapter) => adapter.step,
            Self::Ptwne(_) | Self::Exr | Self::Command(_) => Schedule::STEP,
        }
    }

    /// As it is typed.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Ptwne(_) => "ptwne",
            Self::Exr => "exr",
            Self::Command(_) => "command",
            Self::Adapter(adapter) => adapter.name,
        }
    }

    /// Whether it renders at the size asked for; pictures have theirs.
    pub(crate) fn takes_size(&self) -> bool {
        !matches!(self, Self::Exr)
    }

    /// Whether it can be told the longest path.
    pub(crate) fn takes_depth(&self) -> bool {
        match self {
            Self::Ptwne(_) => true,
            Self::Exr => false,
            Self::Command(_) => false,
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

    /// Renders a quick reference; `None` if it has none.
    fn reference(&mut self) -> Result<Option<Reference>, SourceError> {
        Ok(None)
    }

    /// Shows how far a reference is, where it takes long, and gives it up once `cancel` is set.
    fn watch_reference(&mut self, _bar: ProgressBar, _cancel: Arc<AtomicBool>) {}

    /// What noise its reference was left with, where it has rendered one and can tell.
    fn reference_noise(&self) -> Option<&ReferenceNoise> {
        None
    }

    /// A picture of this seed, or a part of it, as the renderer itself samples it, until its own noise threshold; `None`
    /// if it has none.
    fn adaptive(
        &mut self,
        _threshold: f64,
        _most: Option<u64>,
        _seed: u32,
        _part: Option<Tile>,
    ) -> anyhow::Result<Option<AdaptivePicture>> {
        Ok(None)
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

    fn reference(&mut self) -> Result<Option<Reference>, SourceError> {
        Ptwne::reference(self).map(Some)
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

impl Resources {
    /// Makes the pool of threads that was asked for.
    pub fn start_threads(&self) -> anyhow::Result<()> {
        start_threads(self.threads)
    }
}

/// Starts that many threads, for everything that shares work; by default as many as there are cores.
pub fn start_threads(threads: Option<NonZeroUsize>) -> anyhow::Result<()> {
    if let Some(threads) = threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads.get()).build_global().context("--threads")?;
    }
    Ok(())
}

impl SourceJob {
    /// The scene, as whoever opens it takes it.
    fn scene(&self) -> Option<&OsStr> {
        self.scene.as_deref().map(Path::as_os_str)
    }

    /// The same from whatever folder it is opened.
    pub fn absolute(&self) -> anyhow::Result<Self> {
        let is_name = |scene: &JobPath| {
            matches!(self.kind, SourceKind::Ptwne(_)) && scene.to_str().and_then(scenes::by_name).is_some()
        };
        let scene = match &self.scene {
            Some(scene) if !is_name(scene) => Some(scene.absolute().context("the current folder")?),
            scene => scene.clone(),
        };
        let mut all = Self { scene, ..self.clone() };
        if let Some(root) = &mut all.scene_files.root {
            *root = std::path::absolute(&*root).context("the current folder")?;
        }
        Ok(all)
    }

    /// The source of a frame of a sequence: its number is filled in in the name of the scene, in values of its
    /// parameters and in the command; a scene file that holds all frames is told. The frame has a seed of its own,
    /// whatever other frames there are, unless all have the same.
    #[must_use]
    pub fn of_frame(&self, frame: i32) -> Self {
        let seed = if self.same_seed { self.seed } else { seed_of_frame(self.seed, frame) };
        let scene = self.scene.as_ref().map(|scene| scene.of_frame(frame));
        let whole = self.holds_all_frames() && scene == self.scene;
        let mut one = Self { scene, seed, same_seed: false, frame: whole.then_some(frame), ..self.clone() };
        let command = if let SourceKind::Command(template) = &mut one.kind { Some(template) } else { None };
        for value in one.scene_files.parameters.values_mut().chain(command) {
            if let Some(filled) = with_frame(value, frame) {
                *value = filled;
            }
        }
        one
    }

    /// The same scene with other samples, to audit a render by.
    pub fn audited(&self, seed: u64) -> anyhow::Result<Self> {
        if self.kind == SourceKind::Exr {
            bail!("pictures that are played back have no other samples to compare with");
        }
        // Longer than the words of a frame: no render has that seed
        let seed = scattered(&[0, self.seed, seed].map(u64::to_le_bytes).concat());
        Ok(Self { seed, ..self.clone() })
    }

    /// Whether the renderer can be told which frame of a scene file it is to render.
    fn holds_all_frames(&self) -> bool {
        matches!(self.kind, SourceKind::Adapter(adapter) if adapter.frames)
    }

    /// Whether the job says where the number of a frame stands; a name for the sequence.
    pub fn check_frames(&self) -> anyhow::Result<PathBuf> {
        let command = if let SourceKind::Command(template) = &self.kind { Some(template) } else { None };
        let mut values = self.scene_files.parameters.values().chain(command);
        let in_values = values.any(|value| with_frame(value, 0).is_some());
        let before = self.scene.as_ref().and_then(JobPath::before_frame);
        match (&self.scene, before) {
            (_, Some(before)) => Ok(before),
            (Some(scene), None) if in_values || self.holds_all_frames() => Ok(scene.with_extension("")),
            (None, None) if in_values => Ok(PathBuf::new()),
            (Some(scene), None) => refuse!(
                "--frames: '{}' does not say where the number of the frame stands: \
                 write {{frame}} or {{frame:04}} there, once (####, %04d and $F4 do, too), \
                 or into a value of --define. One .blend file holds all frames, with --source cycles",
                scene.display()
            ),
            (None, None) => {
                refuse!("--frames needs a scene with {{frame}} in its name, as in 'hall.{{frame:04}}.xml'")
            }
        }
    }

    /// Where samples come from, for the picture's file; none for pictures that are played back. What else
    /// they depend on beside seed and size goes in as a digest: pictures travel further than paths should.
    pub fn origin(&self, scene: &str, source: &str, repeats: bool) -> anyhow::Result<Option<SampleOrigin>> {
        if self.kind == SourceKind::Exr {
            return Ok(None);
        }
        let options = serde_json::to_vec(&Self { seed: 0, size: None, ..self.absolute()? })?;
        let options = blake3::hash(&options).to_hex()[..16].to_owned();
        let source = format!("{scene} by {source}");
        Ok(Some(SampleOrigin::new(source, options, self.seed, repeats)))
    }

    /// Most camera rays a pixel for albedo and normals, of each half, where they are not clean with fewer. Of the built-in
    /// renderer, most pixels take far fewer; with other renderers, more would take longer than to clean them.
    pub fn first_hits_spp(&self) -> u64 {
        if matches!(self.kind, SourceKind::Ptwne(_)) { 128 } else { 32 }
    }

    pub fn open(&self, resources: Resources) -> anyhow::Result<Opened> {
        match &self.kind {
            SourceKind::Ptwne(options) => self.open_ptwne(*options),
            SourceKind::Exr => {
                let folder = self.scene().context("--source exr needs a folder of pictures")?;
                let source = Box::new(StackSource::open(folder)?);
                Ok(Opened { source, scene: stem(folder), warnings: Vec::new() })
            }
            SourceKind::Command(template) => adapters::open_command(template, self, resources),
            SourceKind::Adapter(adapter) => adapters::open_adapter(adapter, self, resources),
        }
    }

    fn open_ptwne(&self, options: PtwneOptions) -> anyhow::Result<Opened> {
        let Loaded { scene, size, max_depth, clamp: asked, warnings } =
            load(self.scene().unwrap_or(OsStr::new(DEFAULT_SCENE)), &self.scene_files)?;
        let (width, height) = self.size.or(size).unwrap_or(DEFAULT_SIZE);
        let name = scene.name().to_owned();
        let PtwneOptions { estimator, sampling, filter, clamp } = options;
        let options = RenderOptions {
            seed: self.seed,
            max_depth: self.max_depth.or(max_depth).unwrap_or(DEFAULT_DEPTH),
            estimator,
            sampling,
            filter,
            clamp: clamp.or(asked),
            ..RenderOptions::default()
        };
        let source = Box::new(Ptwne::new(scene, width, height, options)?.with_program(program_digest()?));
        let warnings = group_warnings(&warnings).iter().map(ToString::to_string).collect();
        Ok(Opened { source, scene: name, warnings })
    }
}

/// Samples tiles until each has as many samples per pixel as are wanted of it, in both halves alike; says which share of them
/// is there.
pub fn fill(
    source: &mut dyn Source,
    film: &mut Film,
    wanted: &[(Tile, u64)],
    mut told: impl FnMut(f64),
) -> anyhow::Result<()> {
    /// Samples per pixel between two looks at the signals.
    const BATCH: u64 = 64;
    let all: u64 = wanted.iter().map(|(_, spp)| spp).sum();
    loop {
        let missing = |(tile, spp): &(Tile, u64)| spp.saturating_sub(film.spp(tile.index));
        let behind = wanted.iter().filter(|tile| missing(tile) > 0);
        // A request belongs to the half with fewer: in pairs, both stay alike
        let request = |tile: &(Tile, u64)| film.request(tile.0.index, missing(tile).div_ceil(2).min(BATCH));
        let requests: Vec<_> = behind.map(request).collect();
        told(1.0 - wanted.iter().map(missing).sum::<u64>() as f64 / all.max(1) as f64);
        if requests.is_empty() {
            return Ok(());
        }
        for batch in source.sample(&requests)? {
            if batch.spp == 0 {
                bail!("the source has no more samples");
            }
            film.add(batch.tile.index, batch.spp, &batch.mean)?;
        }
    }
}

/// The seed of a frame. Scattered, since some renderers derive related random numbers from neighbouring seeds; of as
/// many bits as all languages take for an integer.
fn seed_of_frame(seed: u64, frame: i32) -> u64 {
    let mut words = [0; 12];
    words[..8].copy_from_slice(&seed.to_le_bytes());
    words[8..].copy_from_slice(&frame.to_le_bytes());
    scattered(&words)
}

fn scattered(words: &[u8]) -> u64 {
    let digest = blake3::hash(words);
    let first: [u8; 8] = std::array::from_fn(|i| digest.as_bytes()[i]);
    u64::from_le_bytes(first) >> 11
}

/// A built-in scene of that name, or the scene in that file.
fn load(scene: &OsStr, options: &LoadOptions) -> anyhow::Result<Loaded> {
    if let Some(scene) = scene.to_str().and_then(scenes::by_name) {
        return Ok(Loaded { scene, size: None, max_depth: None, clamp: None, warnings: vec![] });
    }
    let path = Path::new(scene);
    if path.extension().is_none() && !path.exists() {
        let typed = scene.to_string_lossy();
        let names = scenes::list().chain(scenes::stiff()).map(|scene| scene.name);
        let near =
            names.min_by_key(|name| levenshtein(&typed, name)).filter(|name| levenshtein(&typed, name) <= 2);
        let meant = near.map_or(String::new(), |name| format!("did you mean {name}? "));
        bail!(
            "there is no built-in scene {scene:?}, and no file of that name; \
             {meant}`noisefloor scenes` lists the scenes"
        );
    }
    noisefloor_scenefile::load_with(path, options).map_err(|error| match (&error.fault, elsewhere(path)) {
        (LoadFault::Format, Some(advice)) => Usage(format!("{}: {advice}", path.display())).into(),
        (LoadFault::LeftOut, _) => Usage(error.to_string()).into(),
        _ => error.into(),
    })
}

/// What to type for a file that the built-in renderer does not read, if that is known.
fn elsewhere(path: &Path) -> Option<&'static str> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    Some(match ending.as_str() {
        "blend" => "Blender's files are rendered by Cycles: add --source cycles",
        "py" => "scripts that build a scene in Blender are rendered by Cycles: add --source cycles",
        "cfg" | "scn" => "LuxCore's files are rendered by LuxCore: add --source luxcore",
        "lxs" | "lxm" | "lxo" => {
            "files of the old LuxRender are read by no source; BlendLuxCore and LuxCore write .cfg and .scn, \
             which --source luxcore reads"
        }
        "obj" | "fbx" | "dae" | "stl" | "ply" | "abc" | "usd" | "usda" | "usdc" | "usdz" | "3ds" | "x3d" => {
            "this is a model, which Blender imports: save it from there as .glb, or as .blend for --source cycles"
        }
        "ass" | "rib" | "mi" | "ifd" | "vrscene" | "max" | "ma" | "mb" | "c4d" | "hip" | "hiplc"
        | "hipnc" => {
            "files of this program are read by no source: render with the program itself, \
             --source 'command: PROGRAM …', or export the scene as glTF (.glb)"
        }
        "exr" | "pfm" | "png" | "jpg" | "jpeg" | "hdr" => {
            "this is a picture: `noisefloor judge` looks at pictures, and --source exr plays back a folder of them"
        }
        _ => return None,
    })
}

/// `hall` of `rooms/hall.xml`, and of `rooms/hall/`.
fn stem(path: &OsStr) -> String {
    let stem = Path::new(path).file_stem().map(|stem| stem.to_string_lossy().into_owned());
    stem.unwrap_or_else(|| "scene".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn frames_have_seeds_of_their_own() {
        let seeds = (1..4).flat_map(|seed| (-2500..2500).map(move |frame| seed_of_frame(seed, frame)));
        let seeds: HashSet<u64> = seeds.collect();
        assert!(seeds.len() == 15_000 && seeds.iter().all(|&seed| seed < 1 << 53));
    }
}
