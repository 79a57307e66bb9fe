//! Options about who renders.

use super::scenes::SceneFileArgs;
use super::values;
use crate::refuse;
use crate::sources::{PtwneOptions, Resources, SourceJob, SourceKind};
use crate::spell::JobPath;
use clap::{Args, ValueEnum, ValueHint};
use noisefloor_ptwne::{Estimator, Filter, Sampling};
use noisefloor_sidecar::Device;
use std::ffi::OsStr;
use std::num::NonZeroUsize;
use std::time::Duration;

/// Who renders, and how.
#[derive(Debug, Args)]
pub struct RendererArgs {
    /// The renderer: `ptwne`, the built-in path tracer; `mitsuba`, `cycles`, `luxcore` (path tracing),
    /// `luxcore-sobol`, `luxcore-metropolis` or `luxcore-bidir`, which `noisefloor doctor` installs (`blender` is
    /// `cycles`); `exr`,
    /// which plays back a folder of pictures; or `command: PROGRAM …`, any program that renders into an EXR
    /// or PFM file. In its arguments, {scene} {seed} {spp} {out} are filled in, and {x0} {x1} {y0} {y1} if
    /// it can render tiles (x1 and y1 are exclusive).
    #[arg(long, default_value = "ptwne", value_name = "SOURCE", value_parser = source, value_hint = ValueHint::Other)]
    source: SourceKind,
    /// Other renderers, and denoisers: abort a call after this many seconds.
    #[arg(long, default_value = "1800", value_name = "SECONDS", value_parser = values::seconds)]
    timeout: Duration,
    /// Image size in pixels [default: the size in the scene file or of the program's pictures, else
    /// 384x384].
    #[arg(long, value_name = "WxH", value_parser = values::size)]
    size: Option<(usize, usize)>,
    /// Seed of the random numbers. The same seed gives the same image and the same stops on any number of
    /// threads. (Other renderers may not promise this.) Each frame of a sequence has a seed of its own, which
    /// follows from this one and its number.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads [default: one a core].
    #[arg(long, value_name = "N", value_parser = values::threads)]
    threads: Option<NonZeroUsize>,
    /// Other renderers: what renders: `auto`, a GPU if one works; `cpu`; `gpu`; the number of a GPU, as `noisefloor doctor` lists them,
    /// or a part of its name [default: what Blender's scene says, else cpu].
    #[arg(long, value_name = "DEVICE")]
    device: Option<Device>,
    /// Longest path in segments: 1 is light seen directly, 2 is direct light [default: what the scene file
    /// says, else 65].
    #[arg(long, value_name = "N")]
    max_depth: Option<u32>,
    /// Built-in renderer: no multiple importance sampling, but the plain path tracing with next event
    /// estimation of the paper.
    #[arg(long)]
    no_mis: bool,
    /// Built-in renderer: how samples are distributed [default: sobol].
    #[arg(long, value_enum)]
    sampler: Option<SamplerChoice>,
    /// Built-in renderer: reconstruction filter [default: box].
    #[arg(long, value_enum)]
    filter: Option<FilterChoice>,
    /// Built-in renderer: scale down samples whose largest channel exceeds this. Removes fireflies, and
    /// light; report.json counts the clamped samples [default: never].
    #[arg(long, value_name = "RADIANCE")]
    clamp: Option<f32>,
    #[command(flatten)]
    scene_files: SceneFileArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SamplerChoice {
    /// Each sample on its own.
    Independent,
    /// Owen-scrambled Sobol points, independent for each pixel and half: about half as many samples do.
    Sobol,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FilterChoice {
    /// The pixel itself.
    Box,
    /// A tent over two pixels.
    Tent,
    /// A Gaussian with a standard deviation of half a pixel.
    Gaussian,
}

fn source(text: &str) -> Result<SourceKind, String> {
    match text.split_once(':') {
        None if text == "ptwne" => Ok(SourceKind::Ptwne(PtwneOptions::default())),
        None if text == "exr" => Ok(SourceKind::Exr),
        Some(("command", template)) => Ok(SourceKind::Command(template.trim().to_owned())),
        _ => match text.parse() {
            Ok(adapter) => Ok(SourceKind::Adapter(adapter)),
            Err(error) => Err(format!("{error}; or `ptwne`, `exr`, or `command: PROGRAM …`")),
        },
    }
}

impl RendererArgs {
    /// Who renders that scene, checked.
    pub fn check(self, scene: Option<&OsStr>) -> anyhow::Result<(SourceJob, Resources)> {
        self.check_options()?;
        let kind = match self.source {
            SourceKind::Ptwne(_) => SourceKind::Ptwne(PtwneOptions {
                estimator: if self.no_mis { Estimator::NextEvents } else { Estimator::Mis },
                sampling: match self.sampler {
                    Some(SamplerChoice::Independent) => Sampling::Independent,
                    None | Some(SamplerChoice::Sobol) => Sampling::Sobol,
                },
                filter: match self.filter {
                    None | Some(FilterChoice::Box) => Filter::Box,
                    Some(FilterChoice::Tent) => Filter::Tent,
                    Some(FilterChoice::Gaussian) => Filter::Gaussian,
                },
                clamp: self.clamp,
            }),
            other => other,
        };
        let resources = Resources { threads: self.threads, timeout: self.timeout };
        let scene = scene.map(JobPath::from);
        let scene_files = self.scene_files.check();
        let Self { seed, size, max_depth, device, .. } = self;
        let (same_seed, frame) = (false, None);
        let job = SourceJob { kind, scene, seed, same_seed, frame, size, max_depth, device, scene_files };
        Ok((job, resources))
    }

    /// Whether our own path tracer renders.
    pub fn is_built_in(&self) -> bool {
        matches!(self.source, SourceKind::Ptwne(_))
    }

    /// Whether our own path tracer renders a picture that was asked for in so small a size.
    pub fn has_fewer_pixels(&self, pixels: u64) -> bool {
        self.is_built_in() && self.size.is_some_and(|(width, height)| ((width * height) as u64) < pixels)
    }

    /// With independent samples in the built-in renderer, unless others were asked for.
    #[must_use]
    pub fn independent_by_default(mut self) -> Self {
        if self.is_built_in() {
            self.sampler.get_or_insert(SamplerChoice::Independent);
        }
        self
    }

    /// Samples per pixel between two verdicts, at the least.
    pub fn step(&self) -> u64 {
        self.source.step()
    }

    /// Refuses options that the source would ignore.
    fn check_options(&self) -> anyhow::Result<()> {
        let name = self.source.name();
        let ptwne = self.is_built_in();
        let given = [
            ("--no-mis", self.no_mis && !ptwne),
            ("--sampler", self.sampler.is_some() && !ptwne),
            ("--filter", self.filter.is_some() && !ptwne),
            ("--clamp", self.clamp.is_some() && !ptwne),
            ("--size", self.size.is_some() && !self.source.takes_size()),
            ("--device", self.device.is_some() && !matches!(self.source, SourceKind::Adapter(_))),
            ("--max-depth", self.max_depth.is_some() && !self.source.takes_depth()),
        ];
        if let Some((option, _)) = given.iter().find(|(_, given)| *given) {
            refuse!("{option} is not an option of --source {name}; leave it out");
        }
        Ok(())
    }
}
