//! `noisefloor render`.

use super::audit::places;
use super::verdicts::{CriterionChoice, Preset, VerdictArgs};
use crate::job::{Autosave, CriterionJob, RenderJob, RenderRun, WatchPage};
use crate::render::{SequenceExposure, SequenceRun, TEV_ADDRESS, exposure_of};
use clap::{Args, Command, FromArgMatches};
use noisefloor::{Audience, Viewing};
use noisefloor_cli::folder::Earlier;
use noisefloor_cli::options::denoiser::DenoiserChoice;
use noisefloor_cli::options::eyes::EyesArgs;
use noisefloor_cli::options::oracle::OracleArgs;
use noisefloor_cli::options::renderer::RendererArgs;
use noisefloor_cli::options::tone::ToneArgs;
use noisefloor_cli::options::values;
use noisefloor_cli::options::viewing::ViewingArgs;
use noisefloor_cli::refuse;
use noisefloor_cli::say::note;
use noisefloor_cli::sources::SourceJob;
use noisefloor_cli::spell::JobPath;
use noisefloor_denoise::DenoisePasses;
use noisefloor_eyes::Person;
use noisefloor_farm::Frames;
use noisefloor_sidecar::Device;
use std::convert::Infallible;
use std::ffi::OsString;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::str::FromStr;
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
  noisefloor calibrate                                once, two minutes: renders then stop for your eyes
  noisefloor render --audience art-students          for more demanding viewers (more samples)
  noisefloor render --denoise oidn                   for a picture that will be denoised (fewer samples)
  noisefloor render --time 60 --against truth.exr    at most a minute; relMSE to a reference in timeline.csv
  noisefloor render --time 60 --resume               another minute of the render in the output folder
  noisefloor render --max-spp 40000 --resume         more samples where the limit was reached
  noisefloor render --frames 1-240 --fps 24 'shots/hall.{frame:04}.xml'   a film, into out/hall/0001 and so on
  noisefloor render --config shot.toml --preset draft     options from a file; a quick look
  noisefloor render --watch                          the picture so far, in a browser
  noisefloor render --force                          once more, over the render in the output folder")]
pub struct RenderArgs {
    /// Built-in scene (`noisefloor scenes` lists them) or scene file: glTF 2.0 (.gltf, .glb), Mitsuba XML
    /// (.xml) or pbrt (.pbrt). With --source, whatever that source reads [default: cornell-box].
    scene: Option<OsString>,
    /// Output folder [default: out/SCENE].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Be done after this many seconds, with all files written: tiles that are still open then stop.
    #[arg(long, value_name = "SECONDS", value_parser = values::seconds)]
    time: Option<Duration>,
    /// Continue the render that Ctrl-C, --time or a kill interrupted in this output folder. Picture and
    /// stops are those of an uninterrupted render. Options must be the same, and so must the contents of
    /// the scene and of all files that it reads; but --max-spp may be larger, also of a finished render. Works with sources that repeat their samples: `ptwne`,
    /// `exr`, `cycles`, and `mitsuba` with libLLVM; and with the oracle or `spp:N`.
    #[arg(long)]
    resume: bool,
    /// Overwrite the render that is in the output folder, finished or not. Without it, a folder that holds
    /// one is refused.
    #[arg(long, conflicts_with = "resume")]
    force: bool,
    /// `draft` for a quarter of the samples that people ask for: noise that is twice as strong as what is
    /// just seen (with --denoise, 0.9 JOD lost). `final` for two verdicts in a row, so that fewer tiles
    /// stop by luck; with `--denoise oidn` it takes a third less time, or better, in half of the scenes tried.
    #[arg(long, value_enum)]
    preset: Option<Preset>,
    /// Judge the picture that this denoiser makes of the samples, and write it: `oidn`, Open Image Denoise
    /// (`noisefloor doctor --install oidn`). Its error is measured from the two halves of the samples, bias
    /// included. What both halves miss, such as a caustic that no sample has found, it cannot know.
    #[arg(long, value_enum, conflicts_with_all = ["model", "threshold", "schedule", "criterion", "audience"])]
    denoise: Option<DenoiserChoice>,
    /// With --denoise: what denoises, as `--device` says what renders [default: cpu].
    #[arg(long, value_name = "DEVICE", requires = "denoise")]
    denoise_device: Option<Device>,
    /// No progress bar and no summary.
    #[arg(long, short)]
    quiet: bool,
    /// Render this many tiles again at the end, with another seed, to four times their samples, and say what the picture has
    /// lost there: see `noisefloor audit --help`.
    #[arg(long, value_name = "PLACES", value_parser = places)]
    audit: Option<usize>,
    /// With --audit: end with exit code 3 if fewer than 19 of 20 places keep the limit.
    #[arg(long, requires = "audit")]
    check: bool,
    /// Render a sequence: frames 1-240, every fifth by 1-100x5, a list as in 1,5,9-12, or -3--1. SCENE holds {frame},
    /// or {frame:04} for four digits, in place of the number (####, %04d and $F4 do, too); so may --against. One file
    /// can hold all frames: {frame} then stands in a value of --define, and a .blend file with --source cycles needs
    /// none. Each frame goes into a folder of its own, and frames.csv sums
    /// up. --resume goes on where the sequence was interrupted. Each frame has a seed of its own, and all have
    /// one exposure (--exposure-from). With --fps, they are judged as frames of a film.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    frames: Option<Frames>,
    /// Render only this many frames of --frames, at equal distances, and say what all of them will take:
    /// samples per pixel and time, with a range, into forecast.json. The frames are kept: without this
    /// option, --resume goes on from them [default: 5].
    #[arg(
        long,
        value_name = "FRAMES",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "5",
        requires = "frames",
        value_parser = few
    )]
    forecast: Option<usize>,
    /// Give all frames the same seed. Their noise then stands still on the screen, like dirt on the lens, and
    /// takes about three times the samples to vanish.
    #[arg(long, conflicts_with = "fps")]
    same_seed: bool,
    /// Options from a file, as max-spp = 2000 or denoise = "oidn", a line each. What is typed as well wins.
    #[arg(long, value_name = "FILE.toml")]
    config: Option<PathBuf>,
    /// Seconds between two refreshes of the files in the output folder while rendering; 0 for none [default:
    /// 30, or as many as keep all refreshes within 2 % of the time].
    #[arg(long, value_name = "SECONDS", value_parser = autosave)]
    autosave: Option<Autosave>,
    #[arg(long, alias = "samples", hide = true, value_parser = no_spp)]
    spp: Option<String>,
    #[command(flatten, next_help_heading = "Renderer")]
    renderer: RendererArgs,
    #[command(flatten, next_help_heading = "Verdicts")]
    oracle: OracleArgs,
    #[command(flatten, next_help_heading = "Verdicts")]
    verdicts: VerdictArgs,
    #[command(flatten, next_help_heading = "What people see")]
    tone: ToneArgs,
    /// Where Reinhard's operator takes its exposure from, so that a film does not flicker: `first`, the first
    /// frame that is rendered; the number of another one, or of several, as in 1,60,120, between which it is
    /// eased; the output folder of another render; or `each`, from every frame by itself [default: first].
    /// --exposure gives it as a number.
    #[arg(
        long,
        value_name = "WHERE",
        help_heading = "What people see",
        conflicts_with = "exposure",
        allow_hyphen_values = true
    )]
    exposure_from: Option<ExposureFrom>,
    #[command(flatten, next_help_heading = "What people see")]
    viewing: ViewingArgs,
    /// Judge as a frame of a film of so many frames per second, each with new noise: people's eyes average over
    /// it. By the vision model; nobody has been asked about films.
    #[arg(long, value_name = "RATE", value_parser = rate, help_heading = "What people see")]
    fps: Option<f64>,
    #[command(flatten, next_help_heading = "What people see")]
    eyes: EyesArgs,
    #[command(flatten, next_help_heading = "To look on")]
    look: LookArgs,
}

/// What people need first: all that `-h` shows.
const FIRST: &[&str] = &[
    "scene", "out", "time", "resume", "force", "preset", "denoise", "quiet", "source", "size", "seed",
    "help", "version",
];

/// The command, with what people need first in its short help.
pub fn brief(render: Command) -> Command {
    render.mut_args(|arg| {
        let first = FIRST.contains(&arg.get_id().as_str());
        arg.hide_short_help(!first)
    })
}

/// How a render is watched.
#[derive(Debug, Args)]
struct LookArgs {
    /// Converged picture of the same size to compare with: relMSE in timeline.csv and report.json.
    #[arg(long, value_name = "FILE.exr")]
    against: Option<PathBuf>,
    /// Show the picture in the viewer tev while it is rendered: samples and probabilities, too. A tev that
    /// runs on this machine is found by itself.
    #[arg(
        long,
        value_name = "HOST:PORT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = TEV_ADDRESS
    )]
    tev: Option<String>,
    /// Serve a page with the picture so far, the tiles that are open, and the time left. It is for this
    /// machine unless an address says otherwise.
    #[arg(
        long,
        value_name = "IP:PORT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "127.0.0.1:8439"
    )]
    watch: Option<SocketAddr>,
    /// With --watch: another name of this machine that browsers may use. Repeat for more.
    #[arg(long, value_name = "HOST", requires = "watch")]
    allow_host: Vec<String>,
}

/// JODs that a tile of a draft may have lost: three times as many, as zones of the human data lose by twice
/// the noise.
const DRAFT_LOST: f64 = 0.9;

/// Where the exposure of a sequence comes from.
#[derive(Clone, Debug, PartialEq)]
enum ExposureFrom {
    First,
    Frames(Vec<i32>),
    Render(PathBuf),
    Each,
}

impl FromStr for ExposureFrom {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        let frames: Result<Vec<i32>, _> = text.split(',').map(str::parse).collect();
        Ok(match (text, frames) {
            ("first", _) => Self::First,
            ("each", _) => Self::Each,
            (_, Ok(mut frames)) => {
                frames.sort_unstable();
                frames.dedup();
                Self::Frames(frames)
            }
            _ => Self::Render(text.into()),
        })
    }
}

/// Frames per second that the vision model takes.
pub(super) fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().map_err(|_| "expected frames per second, such as 24".to_owned())?;
    Viewing::default().with_frames_per_second(Some(rate)).map_err(|error| error.to_string())?;
    Ok(rate)
}

/// Fewer frames say nothing about a range.
fn few(text: &str) -> Result<usize, String> {
    values::within(text, 3..=1_000_000)
}

/// As seconds, or 0 for never.
fn autosave(text: &str) -> Result<Autosave, String> {
    if text.parse() == Ok(0.0) { Ok(Autosave::Never) } else { values::seconds(text).map(Autosave::Every) }
}

/// `render --spp 100` is what people try first.
fn no_spp(text: &str) -> Result<String, String> {
    Err(format!(
        "`render` stops each tile when nobody sees noise in it; for {text} samples everywhere, \
         use --criterion spp:{text}"
    ))
}

impl RenderArgs {
    /// The command by itself.
    pub fn alone() -> Command {
        Self::augment_args(Command::new("noisefloor render").no_binary_name(true))
    }

    /// What follows `noisefloor render`.
    pub fn parsed(typed: impl IntoIterator<Item = OsString>) -> Result<Self, clap::Error> {
        Self::from_arg_matches(&Self::alone().try_get_matches_from(typed)?)
    }

    /// A render that can begin.
    pub fn check(self) -> anyhow::Result<RenderRun> {
        if matches!(self.exposure_from, Some(ExposureFrom::First | ExposureFrom::Frames(_))) {
            refuse!(
                "--exposure-from: frames need --frames; \
                 a single render takes the exposure of another render, by its output folder"
            );
        }
        self.check_one()
    }

    /// A render, or any frame of a sequence.
    fn check_one(self) -> anyhow::Result<RenderRun> {
        if cfg!(not(feature = "watch")) && self.look.watch.is_some() {
            refuse!(
                "this build has no 'render --watch': run `cargo run --release --features watch -- render --watch …`"
            );
        }
        let by_oracle = self.denoise.is_none() && self.verdicts.criterion == CriterionChoice::Oracle;
        let said =
            [("--viewing", self.viewing.typed().is_some()), ("--audience", self.verdicts.audience.is_some())];
        let eyes = if by_oracle {
            self.eyes.of(self.oracle.model.as_deref(), &said)?
        } else {
            self.eyes.unused(if self.denoise.is_some() { "--denoise" } else { "this --criterion" })?;
            None
        };
        let audience = eyes.as_ref().map_or(Audience::TRAINED, Person::audience);
        let limits = self.verdicts.limits(self.denoise.is_some(), &self.renderer, self.preset, audience)?;
        let criterion = match (self.denoise, self.verdicts.criterion) {
            (Some(_), _) => {
                let lost = self.verdicts.lost;
                // What is seldom worth 5 % of the time of a fast renderer
                let usual =
                    if self.renderer.is_built_in() { DenoisePasses::One } else { DenoisePasses::Four };
                let passes = self.verdicts.denoise_passes.unwrap_or(usual);
                let draft = self.preset == Some(Preset::Draft);
                CriterionJob::Denoised {
                    lost: if draft { lost.max(DRAFT_LOST) } else { lost },
                    passes,
                    device: self.denoise_device,
                }
            }
            (None, CriterionChoice::Oracle) => {
                let OracleArgs { model, people, .. } = self.oracle;
                let scatter = eyes.as_ref().map(Person::uncertainty);
                CriterionJob::Oracle { model: model.map(JobPath), people, scatter }
            }
            (None, CriterionChoice::Fixed(samples)) => CriterionJob::Spp(samples),
            (None, CriterionChoice::Rival(spec)) => CriterionJob::Rival(spec),
        };
        if by_oracle && self.preset == Some(Preset::Final) && !self.quiet {
            note!(
                "a denoised picture takes a third less time, or better, in half of the scenes tried: add --denoise oidn"
            );
        }
        let (source, resources) = self.renderer.check(self.scene.as_deref())?;
        let source = SourceJob { same_seed: self.same_seed, ..source };
        let viewing = self.viewing.typed().or_else(|| eyes.map(|person| person.viewing()));
        let in_film = viewing.and_then(|viewing| viewing.frames_per_second());
        if in_film.is_some() && self.fps.is_some() {
            refuse!("give either --fps or the fps of --viewing, not both");
        }
        if in_film.is_some() && self.same_seed {
            refuse!(
                "a film is judged as one whose noise is new in every frame: leave out --same-seed, or fps"
            );
        }
        let mut tone = self.tone.check()?;
        if self.exposure_from.is_some() && !tone.settles() {
            refuse!("--exposure-from: --tone-mapping {} has the exposure of --exposure", tone.name());
        }
        if let Some(ExposureFrom::Render(render)) = &self.exposure_from {
            tone = tone.exposed_as(exposure_of(render)?);
        }
        let hosts = self.look.allow_host;
        Ok(RenderRun {
            job: RenderJob { source, criterion, tone, viewing, frames_per_second: self.fps, limits },
            resources,
            out: self.out.map(JobPath),
            time: self.time,
            against: self.look.against.map(JobPath),
            autosave: self.autosave.unwrap_or(Autosave::Paced),
            earlier: Earlier::of(self.force, self.resume),
            quiet: self.quiet,
            tev: self.look.tev,
            watch: self.look.watch.map(|address| WatchPage { address, hosts }),
            audit: self.audit,
            check: self.check,
        })
    }

    /// Whether several frames are asked for.
    pub fn is_sequence(&self) -> bool {
        self.frames.is_some()
    }

    /// A render of which these are frames, and where their exposure comes from.
    pub fn check_of(self, frames: &Frames) -> anyhow::Result<(RenderRun, SequenceExposure)> {
        let from = self.exposure_from.clone().unwrap_or(ExposureFrom::First);
        let typed = self.exposure_from.is_some();
        let run = self.check_one()?;
        run.job.source.check_frames()?;
        let exposure = match from {
            ExposureFrom::First if run.job.tone.settles() => {
                SequenceExposure::Of(vec![frames.first()], typed)
            }
            ExposureFrom::Frames(frames) => SequenceExposure::Of(frames, typed),
            _ => SequenceExposure::Each,
        };
        Ok((run, exposure))
    }

    /// Frames that can begin.
    pub fn check_frames(mut self) -> anyhow::Result<SequenceRun> {
        let Some(frames) = self.frames.take() else { refuse!("--frames is missing") };
        let forecast = self.forecast;
        let (run, exposure) = self.check_of(&frames)?;
        let before = run.job.source.check_frames()?;
        let out = run.out.as_deref().map_or_else(|| PathBuf::from("out").join(stem(&before)), PathBuf::from);
        Ok(SequenceRun { frames, out, run, exposure, forecast })
    }
}

/// A name for a sequence: that of its files, without number and ending.
fn stem(before: &std::path::Path) -> String {
    let text = before.to_string_lossy();
    let name = text.rsplit('/').next().unwrap_or_default().trim_end_matches(['.', '-', '_']);
    if name.is_empty() { "frames".to_owned() } else { name.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::stem;

    #[test]
    fn a_sequence_is_named_by_its_files() {
        assert_eq!(
            ["shots/hall.", "shots/", ""].map(|before| stem(before.as_ref())),
            ["hall", "frames", "frames"]
        );
    }
}
