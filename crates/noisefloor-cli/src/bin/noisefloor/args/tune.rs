//! `noisefloor tune`.

use super::render::rate;
use crate::tune::{KnobChoice, TuneCriterion, TuneJob};
use clap::Args;
use noisefloor::Audience;
use noisefloor::tune::{Knob, Search};
use noisefloor_cli::folder::Earlier;
use noisefloor_cli::options::denoiser::DenoiserChoice;
use noisefloor_cli::options::eyes::{EyesArgs, Seen};
use noisefloor_cli::options::oracle::OracleArgs;
use noisefloor_cli::options::renderer::RendererArgs;
use noisefloor_cli::options::tone::ToneArgs;
use noisefloor_cli::options::values;
use noisefloor_cli::options::viewing::{ViewingArgs, judged_by};
use noisefloor_cli::refuse;
use noisefloor_cli::sources::SourceKind;
use noisefloor_denoise::DEFAULT_JODS_LOST;
use noisefloor_farm::Frames;
use noisefloor_sidecar::Device;
use std::ffi::OsString;
use std::path::PathBuf;

/// Find the renderer's own setting at which nobody sees noise: a noise threshold, or samples per pixel.
///
/// Renderers with a noise threshold (Cycles, LuxCore, and any program) know better than tiles where samples go; what
/// nobody knows is the number. From a coarse setting on, two pictures of different seeds are rendered, and the
/// noise that both leave is judged where it is worst; the next setting follows from how it falls, until nobody
/// would see noise in one of them. That takes two to four steps, each a fraction of the next. --keep writes the mean of the last
/// two pictures.
///
/// With --denoise, the denoised picture is judged: how many just-objectionable differences (JOD) its worst
/// square of 64 pixels has lost. Nobody has been asked about denoised pictures: the limit is the vision model's.
///
/// Without a noise threshold (`ptwne`, `mitsuba`), samples per pixel are sought, the same everywhere;
/// `render` takes fewer, since it stops tile by tile.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor tune shot.blend --source cycles                  Cycles' noise threshold
  noisefloor tune shot.blend --source cycles --denoise oidn   for a picture that will be denoised
  noisefloor tune shot.blend --source cycles --tone-mapping lut:agx.cube --lut-input log2:-10,6.5
  noisefloor tune shot.blend --source cycles --fps 24         for the frames of a film
  noisefloor tune hall/scene.xml --source mitsuba             samples per pixel
  noisefloor tune 'walk.{frame:04}.xml' --frames 1,50,120     one setting for a sequence
  noisefloor tune shot.blend --source cycles --regions 4      first the whole, then its worst places
  noisefloor tune --source 'command: myrender {scene} --noise {threshold} --seed {seed} -o {out}.exr' hall.ass
  noisefloor tune cornell-box --size 192x192 --keep out/tuned --json")]
pub struct TuneArgs {
    /// Scene, as for `render`.
    #[arg(value_name = "SCENE")]
    scene: Option<OsString>,
    /// What is sought [default: the noise threshold, where the renderer has one].
    #[arg(long, value_enum)]
    knob: Option<KnobChoice>,
    /// Where the search begins: the coarsest threshold, or the fewest samples [default: 0.2, 0.04 of LuxCore, or 16].
    #[arg(long, value_name = "SETTING")]
    from: Option<f64>,
    /// Where it ends: the finest threshold, or the most samples [default: 0.001, or 16384].
    #[arg(long, value_name = "SETTING")]
    to: Option<f64>,
    #[arg(long, alias = "samples", hide = true, value_parser = no_spp)]
    spp: Option<String>,
    /// With a threshold: the most samples per pixel of one picture, whatever the threshold [default: what
    /// Blender's scene says; for LuxCore and programs 16384].
    #[arg(long, value_name = "SPP")]
    max_spp: Option<u64>,
    /// Judge the picture that this denoiser makes of the samples: `oidn`, Open Image Denoise (`noisefloor doctor
    /// --install oidn`).
    #[arg(long, value_enum, conflicts_with_all = ["model", "threshold", "people"])]
    denoise: Option<DenoiserChoice>,
    /// With --denoise: what denoises, as `--device` says what renders [default: cpu].
    #[arg(long, value_name = "DEVICE", requires = "denoise")]
    denoise_device: Option<Device>,
    /// With --denoise: just-objectionable differences (JOD) that a square of 64 pixels may have lost.
    #[arg(long, value_name = "JOD", requires = "denoise", default_value_t = DEFAULT_JODS_LOST, value_parser = values::jods)]
    lost: f64,
    /// Write the mean of the last two pictures, what is left in it, and tune.json into this folder.
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// With --keep: go on with the search that was interrupted in that folder.
    #[arg(long, requires = "keep", conflicts_with = "force")]
    resume: bool,
    /// With --keep: overwrite what is in the folder.
    #[arg(long, requires = "keep")]
    force: bool,
    /// Find one setting for a sequence by these of its frames, as in 1,60,120 or 1-240x60: SCENE holds {frame}, or {frame:04} for
    /// four digits, as for `render`.
    /// All are rendered with the first setting, then the worst first, until one fails.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    frames: Option<Frames>,
    /// Render the whole picture only with the first setting and in the end, and in between this many crops of 128 pixels around
    /// what was worst: for large pictures.
    #[arg(long, value_name = "COUNT", conflicts_with = "keep", value_parser = clap::value_parser!(u64).range(1..=64))]
    regions: Option<u64>,
    /// Print JSON instead of lines.
    #[arg(long)]
    json: bool,
    /// No progress, and nothing but the setting on standard output.
    #[arg(long, short, conflicts_with = "json")]
    quiet: bool,
    #[command(flatten, next_help_heading = "Renderer")]
    renderer: RendererArgs,
    #[command(flatten, next_help_heading = "What people see")]
    oracle: OracleArgs,
    #[command(flatten, next_help_heading = "What people see")]
    tone: ToneArgs,
    #[command(flatten, next_help_heading = "What people see")]
    viewing: ViewingArgs,
    /// Find the setting for the frames of a film of so many frames per second, each with new noise: fewer
    /// samples, or a coarser threshold, by the vision model. Nobody has been asked about films.
    #[arg(long, value_name = "RATE", value_parser = rate, help_heading = "What people see")]
    fps: Option<f64>,
    #[command(flatten, next_help_heading = "What people see")]
    eyes: EyesArgs,
}

/// `tune --spp 100` is what people try first.
fn no_spp(text: &str) -> Result<String, String> {
    Err(format!(
        "`tune` finds how many samples are needed: --knob samples looks for their number, \
         up to --to {text}, and --max-spp {text} bounds a picture with a threshold. \
         `render --criterion spp:{text}` takes {text} everywhere"
    ))
}

impl TuneArgs {
    pub fn check(self) -> anyhow::Result<TuneJob> {
        let tone = self.tone.check()?;
        tone.load()?;
        let (source, resources) = self.renderer.check(self.scene.as_deref())?;
        if self.frames.is_some() {
            source.check_frames()?;
        }
        let (coarsest, name) = match &source.kind {
            SourceKind::Adapter(adapter) => (adapter.threshold, adapter.name),
            SourceKind::Command(template) => (template.contains("{threshold}").then_some(0.2), "command"),
            SourceKind::Ptwne(_) => (None, "ptwne"),
            SourceKind::Exr => refuse!("--source exr plays back pictures, and has no setting to find"),
        };
        let adapts = coarsest.is_some();
        let choice = self.knob.unwrap_or(if adapts { KnobChoice::Threshold } else { KnobChoice::Samples });
        match (choice, &source.kind, adapts) {
            (KnobChoice::Threshold, SourceKind::Command(_), false) => {
                refuse!("--knob threshold: the command does not hold {{threshold}}")
            }
            (KnobChoice::Threshold, _, false) => refuse!(
                "--source {name} has no noise threshold that could be tuned; --knob samples finds samples per pixel"
            ),
            (KnobChoice::Samples, SourceKind::Command(_), true) => {
                refuse!("--knob samples: the command holds {{threshold}}; leave it out")
            }
            (KnobChoice::Samples, _, _) if self.max_spp.is_some() => {
                refuse!("--max-spp bounds a search for a threshold; with --knob samples, --to does")
            }
            _ => {}
        }
        let crops = match &source.kind {
            SourceKind::Adapter(adapter) => adapter.crops,
            SourceKind::Command(template) => template.contains("{x0}"),
            SourceKind::Ptwne(_) | SourceKind::Exr => true,
        };
        if self.regions.is_some() && choice == KnobChoice::Threshold && !crops {
            match &source.kind {
                SourceKind::Command(_) => {
                    refuse!("--regions: the command does not hold {{x0}}, {{y0}}, {{x1}} and {{y1}}")
                }
                _ => refuse!(
                    "--regions: --source {name} cannot render a part of a picture as it is in the whole"
                ),
            }
        }
        let whole = |option, value: Option<f64>, default: u64| -> anyhow::Result<u64> {
            match value {
                None => Ok(default),
                Some(n) if n.fract() == 0.0 && (2.0..1e15).contains(&n) => Ok(n as u64),
                Some(n) => refuse!("{option} {n}: a whole number of samples is needed, at least 2"),
            }
        };
        let knob = match choice {
            KnobChoice::Threshold => Knob::Threshold {
                coarsest: self.from.or(coarsest).unwrap_or(0.2),
                finest: self.to.unwrap_or(0.001),
            },
            KnobChoice::Samples => Knob::Samples {
                least: whole("--from", self.from, 16)?,
                most: whole("--to", self.to, 16_384)?,
            },
        };
        let search = match Search::new(knob) {
            Ok(search) => search.with_crops(self.regions.unwrap_or(0) as usize),
            Err(error) => refuse!("--from, --to: {error}"),
        };
        let (criterion, viewing, audience) = if self.denoise.is_some() {
            self.eyes.unused("--denoise")?;
            (
                TuneCriterion::Denoised { lost: self.lost, device: self.denoise_device },
                self.viewing.or_default(),
                Audience::TRAINED,
            )
        } else {
            let Seen { oracle, viewing, audience } = self.eyes.look(&self.oracle, &self.viewing, None)?;
            if !oracle.maps_visible_noise() {
                refuse!("this model does not say how strong noise is; the bundled model does");
            }
            (TuneCriterion::Noise(Box::new(oracle)), viewing, audience)
        };
        if viewing.frames_per_second().is_some() && self.fps.is_some() {
            refuse!("give either --fps or the fps of --viewing, not both");
        }
        let viewing = match self.fps {
            Some(_) => viewing.with_frames_per_second(self.fps)?,
            None => viewing,
        };
        if let TuneCriterion::Noise(oracle) = &criterion {
            judged_by(Some(viewing), oracle)?;
        }
        let frames: Vec<i32> = self.frames.iter().flat_map(Frames::iter).collect();
        Ok(TuneJob {
            source,
            search: search.with_views(frames.len()),
            frames,
            regions: self.regions.unwrap_or(0) as usize,
            resources,
            most_spp: self.max_spp,
            criterion,
            tone,
            viewing,
            audience,
            keep: self.keep,
            earlier: Earlier::of(self.force, self.resume),
            json: self.json,
            quiet: self.quiet,
        })
    }
}
