//! `noisefloor render`.

use super::oracle::OracleArgs;
use super::renderer::RendererArgs;
use super::tone::ToneArgs;
use super::values;
use super::viewing::ViewingArgs;
use crate::folder::Earlier;
use crate::render::{Autosave, FramePattern, Judge, RenderJob, SequenceJob, TEV_ADDRESS};
use anyhow::bail;
use clap::{Args, ValueEnum};
use noisefloor::{Audience, Params, Schedule, tile::DEFAULT_TILE};
use std::ffi::OsString;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

/// Render a scene, and stop each tile when nobody sees noise in it any more.
///
/// Writes into the output folder: image.exr (linear radiance; samples, probability, stop and visible noise
/// as channels), image.png, stops.csv (one line a tile), stops.png (heat map of the samples), noise.png
/// (the noise that is left, and how visible it is), timeline.csv and report.json. Files appear complete or
/// not at all, and are refreshed while rendering (--autosave).
///
/// With --denoise, each tile stops when nobody would see a difference between the denoised picture and the
/// converged one. Nobody has been asked about denoised tiles: the limit is the vision model's.
/// image-denoised.exr, image-denoised.png and denoised-error.png are written as well; and albedo.exr and
/// normal.exr, which help the denoiser, if the renderer has them (ptwne, mitsuba and cycles do).
///
/// Ctrl-C stops all tiles and writes what there is (exit code 130). An interrupted or killed render
/// continues with --resume.
#[derive(Debug, Args)]
#[command(args_override_self = true)]
#[command(after_help = "Examples:
  noisefloor render                                  the Cornell box, into out/cornell-box
  noisefloor render glass-spheres --size 800x600 --seed 7    another scene; `noisefloor scenes` lists them
  noisefloor render hall/scene.xml --out out/hall    a scene file: glTF, Mitsuba XML or pbrt
  noisefloor render --source mitsuba hall/scene.xml  another renderer; `noisefloor doctor` lists them
  noisefloor render --criterion spp:1000             for comparison: a fixed number of samples
  noisefloor render --audience art-students          for more demanding viewers (more samples)
  noisefloor render --denoise oidn                   for a picture that will be denoised (fewer samples)
  noisefloor render --time 60 --against truth.exr    at most a minute; relMSE to a reference in timeline.csv
  noisefloor render --time 60 --resume               another minute of the render in the output folder
  noisefloor render --frames 1-240 'shots/hall.{frame:04}.xml'   a sequence, into out/hall/0001 and so on
  noisefloor render --config shot.toml --preset draft     options from a file; a quick look
  noisefloor render --watch                          the picture so far, in a browser
  noisefloor render --force                          once more, over the render in the output folder")]
pub struct RenderArgs {
    /// Built-in scene (`noisefloor scenes` lists them) or scene file: glTF 2.0 (.gltf, .glb), Mitsuba XML
    /// (.xml) or pbrt (.pbrt). With --source, whatever that source reads [default: cornell-box].
    scene: Option<OsString>,
    #[command(flatten)]
    renderer: RendererArgs,
    /// Output folder [default: out/SCENE].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What stops a tile: `oracle`, `spp:N` for N samples per pixel everywhere, or a criterion of
    /// `noisefloor compare --help`.
    #[arg(long, default_value = "oracle", value_parser = criterion)]
    criterion: CriterionChoice,
    #[arg(long, hide = true, value_parser = values::no_spp)]
    spp: Option<String>,
    /// Judge the picture that this denoiser makes of the samples, and write it: `oidn`, Open Image Denoise
    /// (`noisefloor doctor --install oidn`). Its error is measured from the two halves of the samples, bias
    /// included. What both halves miss, such as a caustic that no sample has found, it cannot know.
    #[arg(long, value_enum, conflicts_with_all = ["model", "threshold", "schedule", "criterion", "audience"])]
    denoise: Option<DenoiserChoice>,
    /// With --denoise: just-objectionable differences (JOD) that a tile may have lost when it stops. At 1,
    /// three of four people prefer the converged picture; the default is what zones had lost, on average, where
    /// people stopped seeing noise in them.
    #[arg(long, value_name = "JOD", requires = "denoise", default_value_t = DEFAULT_LOST, value_parser = values::jods)]
    lost: f64,
    #[command(flatten)]
    oracle: OracleArgs,
    #[command(flatten)]
    tone: ToneArgs,
    #[command(flatten)]
    viewing: ViewingArgs,
    /// Tile edge in pixels, 16…512.
    #[arg(long, default_value_t = DEFAULT_TILE, value_name = "PIXELS")]
    tile: usize,
    /// Sample blocks of this many pixels (16 or 32) of a tile by their need: where the vision model sees less
    /// noise, a block gets down to a quarter of the samples of the noisiest one. The verdict stays the
    /// tile's. For the oracle, and for the sources `ptwne` and `mitsuba` (with libLLVM); 0 samples all of a
    /// tile alike.
    #[arg(long, default_value_t = 0, value_name = "PIXELS")]
    blocks: usize,
    /// Samples per pixel between two verdicts on a tile, at the least [default: 10, or 100 with --schedule
    /// every; with --denoise 48, or 16 of other renderers, and then half as many more each time, or more
    /// where few tiles are open].
    #[arg(long, value_name = "SPP")]
    batch: Option<u64>,
    /// When tiles are judged: `spaced` by the samples that a tile is expected to need, or after `every` batch,
    /// as in the paper: tiles then stop a quarter to two fifths later in ordinary scenes.
    #[arg(long, value_enum, default_value_t = ScheduleChoice::Spaced)]
    schedule: ScheduleChoice,
    /// No tile stops before this many samples per pixel [default: 100, or one batch with --batch or --denoise].
    /// 50 saves more where little is needed, and light that is seldom found is missed more often.
    #[arg(long, value_name = "SPP")]
    min_spp: Option<u64>,
    /// Every tile stops at this many samples per pixel [default: 10000; N with --criterion spp:N].
    #[arg(long, value_name = "SPP")]
    max_spp: Option<u64>,
    /// Be done after this many seconds, with all files written: tiles that are still open then stop.
    #[arg(long, value_name = "SECONDS", value_parser = values::seconds)]
    time: Option<Duration>,
    /// Stop a tile only after K verdicts of "converged" in a row, each a quarter more samples after the last.
    #[arg(long, default_value_t = 1, value_name = "K")]
    consecutive: u32,
    /// For whom: `observers` (those of the training data), `art-students` (T' = 1.94 T - 346), or a,b for
    /// T' = a T + b.
    #[arg(long, default_value = "observers", value_name = "WHO", value_parser = values::audience)]
    audience: Audience,
    /// Converged picture of the same size to compare with: relMSE in timeline.csv and report.json.
    #[arg(long, value_name = "FILE.exr")]
    against: Option<PathBuf>,
    /// Seconds between two refreshes of the files in the output folder while rendering; 0 for none [default:
    /// 30, or as many as keep all refreshes within 2 % of the time].
    #[arg(long, value_name = "SECONDS", value_parser = values::autosave)]
    autosave: Option<Autosave>,
    /// Continue the render that Ctrl-C, --time or a kill interrupted in this output folder. Picture and
    /// stops are those of an uninterrupted render. Options must be the same, and so must the contents of the
    /// scene and of all files that it reads. Works with sources that repeat their samples: `ptwne`, `exr`, `cycles`,
    /// and `mitsuba` with libLLVM; and with the oracle or `spp:N`.
    #[arg(long)]
    resume: bool,
    /// Overwrite the render that is in the output folder, finished or not. Without it, a folder that holds
    /// one is refused.
    #[arg(long, conflicts_with = "resume")]
    force: bool,
    /// Render a sequence: SCENE holds {frame}, or {frame:04} for four digits, in place of the number. Each frame goes
    /// into a folder of its own, and frames.csv sums up. --resume goes on where the sequence was interrupted. All
    /// frames have the same seed: noise then stays where it is on the screen, and flickers a third as much.
    #[arg(long, value_name = "FIRST-LAST", value_parser = values::frames)]
    frames: Option<(u32, u32)>,
    /// Options from a file, as max-spp = 2000 or denoise = "oidn", a line each. What is typed as well wins.
    #[arg(long, value_name = "FILE.toml")]
    config: Option<PathBuf>,
    /// `draft` for a quarter of the samples that people ask for: noise that is twice as strong as what is just seen
    /// (with --denoise, 0.9 JOD lost). `final` for two verdicts in a row, so that fewer tiles stop by luck.
    #[arg(long, value_enum)]
    preset: Option<Preset>,
    /// Show the picture in the viewer tev while it is rendered: samples and probabilities, too. A tev that runs
    /// on this machine is found by itself.
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, require_equals = true, default_missing_value = TEV_ADDRESS)]
    tev: Option<String>,
    /// Serve a page with the picture so far, the tiles that are open, and the time left. It is for this machine
    /// unless an address says otherwise.
    #[arg(long, value_name = "IP:PORT", num_args = 0..=1, require_equals = true, default_missing_value = "127.0.0.1:8439")]
    watch: Option<SocketAddr>,
    /// No progress bar and no summary.
    #[arg(long, short)]
    quiet: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ScheduleChoice {
    Spaced,
    Every,
}

/// What a picture is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Preset {
    Draft,
    Final,
}

/// A quarter of the samples: twice the noise.
const DRAFT: Audience = Audience { slope: 0.25, offset: 0.0 };
/// JODs that a tile of a draft may have lost: three times as many, as zones of the human data lose by twice the noise.
const DRAFT_LOST: f64 = 0.9;

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum DenoiserChoice {
    /// Open Image Denoise, on the CPU.
    Oidn,
}

const DEFAULT_LOST: f64 = noisefloor_denoise::DEFAULT_JODS_LOST;

#[derive(Clone, Debug, PartialEq, Eq)]
enum CriterionChoice {
    Oracle,
    Fixed(u64),
    /// A specification that is known to be right.
    Rival(String),
}

fn criterion(text: &str) -> Result<CriterionChoice, String> {
    match text.split_once(':') {
        None if text == "oracle" => Ok(CriterionChoice::Oracle),
        Some(("spp", n)) => match n.parse() {
            Ok(n) if n > 0 => Ok(CriterionChoice::Fixed(n)),
            _ => Err(format!("spp:{n} needs a positive whole number of samples, as in spp:1000")),
        },
        _ => match noisefloor_rivals::parse(text) {
            Ok(criterion) if criterion.needs().reference => Err(format!(
                "{text} compares with the converged picture, which no render has; it is for `compare`"
            )),
            Ok(_) => Ok(CriterionChoice::Rival(text.to_owned())),
            Err(error) => Err(format!("{error}; or `oracle`")),
        },
    }
}

impl RenderArgs {
    /// A render that can begin.
    pub fn check(self) -> anyhow::Result<RenderJob> {
        #[cfg(not(feature = "study"))]
        if self.watch.is_some() {
            let (what, feature, again) = ("render --watch", "study", "render --watch …");
            return Err(crate::left_out::LeftOut { what, feature, again }.into());
        }
        let mut params = self.params()?;
        let by_oracle = self.denoise.is_none() && self.criterion == CriterionChoice::Oracle;
        if params.blocks > 0 && !(by_oracle && self.renderer.may_sample_blocks()) {
            bail!("--blocks is for the oracle, and for --source ptwne or mitsuba; leave it out")
        }
        let judge = match self.criterion {
            _ if self.denoise.is_some() && self.is_draft() => denoised(self.lost.max(DRAFT_LOST))?,
            _ if self.denoise.is_some() => denoised(self.lost)?,
            CriterionChoice::Rival(spec) if self.resume => {
                bail!("--resume does not work with --criterion {spec}, whose state is not kept; leave it out")
            }
            CriterionChoice::Oracle => {
                let oracle = self.oracle.check()?;
                params.viewing = self.viewing.judged_by(&oracle)?;
                Judge::Oracle(Box::new(oracle))
            }
            CriterionChoice::Fixed(samples) => Judge::Fixed(samples),
            CriterionChoice::Rival(spec) => Judge::Rival(spec),
        };
        Ok(RenderJob {
            source: self.renderer.check(self.scene.as_deref())?,
            judge,
            params,
            out: self.out,
            time: self.time,
            against: self.against,
            autosave: self.autosave.unwrap_or(Autosave::Paced),
            earlier: Earlier::of(self.force, self.resume),
            quiet: self.quiet,
            tev: self.tev,
            #[cfg(feature = "study")]
            watch: self.watch,
        })
    }

    /// Whether several frames are asked for.
    pub fn is_sequence(&self) -> bool {
        self.frames.is_some()
    }

    /// Frames that can begin; each is rendered by a command of its own, which checks the rest.
    pub fn check_frames(&self) -> anyhow::Result<SequenceJob> {
        let (Some(frames), Some(scene)) = (self.frames, &self.scene) else {
            bail!("--frames needs a scene with {{frame}} in its name, as in 'hall.{{frame:04}}.xml'")
        };
        let Some(scene) = scene.to_str() else {
            bail!("--frames: the name of the scene is not UTF-8; rename it")
        };
        let scene = FramePattern::parse(scene)?;
        let out = self.out.clone().unwrap_or_else(|| PathBuf::from("out").join(scene.stem()));
        let typed = super::expand(std::env::args_os().collect())?.split_off(1);
        Ok(SequenceJob { scene, frames, out, resume: self.resume, quiet: self.quiet, typed })
    }

    fn is_draft(&self) -> bool {
        self.preset == Some(Preset::Draft)
    }

    fn params(&self) -> anyhow::Result<Params> {
        let step = |default: u64| self.batch.unwrap_or(default);
        let schedule = match (self.denoise, self.schedule) {
            // What two denoisings cost is worth more samples of the built-in renderer than of slower ones
            (Some(_), _) if self.renderer.is_built_in() => Schedule::Growing { step: step(48) },
            (Some(_), _) => Schedule::Growing { step: step(16) },
            (None, ScheduleChoice::Spaced) => Schedule::Spaced { step: step(10) },
            (None, ScheduleChoice::Every) => Schedule::Every { step: step(100) },
        };
        // With steps that were asked for, or that a denoiser has, the first one is a verdict
        let first =
            if self.batch.or(self.denoise.map(|_| 0)).is_some() { 0 } else { Params::default().min_spp };
        let max_spp = match &self.criterion {
            CriterionChoice::Oracle | CriterionChoice::Rival(_) => {
                self.max_spp.unwrap_or(Params::default().max_spp)
            }
            // Exactly this many, not the next multiple of the batch
            CriterionChoice::Fixed(samples) => self.max_spp.map_or(*samples, |most| most.min(*samples)),
        };
        let params = Params {
            tile: self.tile,
            tone_mapping: self.tone.check()?,
            viewing: self.viewing.or_default(),
            schedule,
            min_spp: self.min_spp.unwrap_or(first.min(max_spp)),
            max_spp,
            consecutive: if self.preset == Some(Preset::Final) {
                self.consecutive.max(2)
            } else {
                self.consecutive
            },
            audience: if self.is_draft() { self.audience.then(DRAFT) } else { self.audience },
            blocks: self.blocks,
        };
        params.check()?;
        Ok(params)
    }
}

#[cfg(feature = "adapters")]
fn denoised(lost: f64) -> anyhow::Result<Judge> {
    Ok(Judge::Denoised(lost))
}

#[cfg(not(feature = "adapters"))]
fn denoised(_lost: f64) -> anyhow::Result<Judge> {
    let (what, feature, again) = ("render --denoise", "adapters", "render --denoise …");
    Err(crate::left_out::LeftOut { what, feature, again }.into())
}
