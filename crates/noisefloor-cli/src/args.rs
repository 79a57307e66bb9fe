//! What can be typed, and what it means once checked.

use crate::sources::{ADAPTERS, Adapter};
use anyhow::Context;
use clap::{Args, Parser, Subcommand, ValueEnum};
use noisefloor::{
    Audience, DEFAULT_KEY, DEFAULT_TILE, Evidence, MAX_TILE, MIN_TILE, Model, Oracle, Params, Schedule,
    Threshold, ToneMapping,
};
use noisefloor_rivals::{RIVALS, Rival};
use std::fs::File;
use std::io::BufReader;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// Tells progressive Monte Carlo renderers, tile by tile, when people stop seeing noise.
///
/// The oracle has learned from people: real observers said at how many samples per pixel they could no longer tell parts of real
/// renders from the converged picture. `render` stops each tile of the built-in path tracer by it, `judge` applies it to pictures
/// rendered elsewhere, and `explore` does in the browser, `train` and `evaluate` make and score models.
#[derive(Debug, Parser)]
#[command(name = "noisefloor", version, max_term_width = 110, propagate_version = true)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    Render(Box<RenderArgs>),
    Reference(ReferenceArgs),
    Compare(CompareArgs),
    Judge(JudgeArgs),
    Explore(ExploreArgs),
    Train(TrainArgs),
    Evaluate(EvaluateArgs),
    Audience(AudienceArgs),
    Reproduce(ReproduceArgs),
    Study(StudyArgs),
    Inspect(InspectArgs),
    Doctor(DoctorArgs),
    /// List the built-in scenes.
    Scenes,
}

/// Render a scene, and stop each tile when nobody sees noise in it any more.
///
/// Writes into the output folder: image.exr (linear radiance, with samples, probability, stop and visible noise as channels),
/// image.png, stops.csv (a line a tile), stops.png (heat map over the picture), noise.png (where noise is still seen, and how
/// strongly), timeline.csv and report.json. Files appear whole or not at all and are refreshed while rendering (--autosave).
/// Ctrl-C stops all tiles and writes what is there (exit code 130); what was broken off, so or by a kill, goes on with --resume.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor render                                  the Cornell box, into out/cornell-box
  noisefloor render glass-spheres --size 800x600 --seed 7    another scene; `noisefloor scenes` lists them
  noisefloor render hall/scene.xml --out out/hall    a scene from a file: .gltf, .glb, or Mitsuba .xml
  noisefloor render --source mitsuba hall/scene.xml  by another renderer; `noisefloor doctor` says which are there
  noisefloor render --criterion spp:1000             for comparison: a fixed number of samples
  noisefloor render --audience art-students          for people who look harder (more samples)
  noisefloor render --time 60 --against truth.exr    a minute at most; relMSE to a reference in timeline.csv
  noisefloor render --time 60 --resume               another minute of what the output folder holds")]
pub struct RenderArgs {
    /// Built-in scene (see `noisefloor scenes`), or a scene file: glTF 2.0 (.gltf, .glb) or Mitsuba XML (.xml); with --source, what
    /// that source reads [default: cornell-box].
    pub scene: Option<String>,
    #[command(flatten)]
    pub renderer: RendererArgs,
    /// Output folder [default: out/SCENE].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// What stops a tile: `oracle`, `spp:N` for N samples per pixel everywhere, or one of the criteria of `noisefloor compare --help`.
    #[arg(long, default_value = "oracle", value_parser = parse_criterion)]
    pub criterion: CriterionChoice,
    #[command(flatten)]
    pub oracle: OracleArgs,
    #[command(flatten)]
    pub tone: ToneArgs,
    /// Tile edge in pixels, 16…512.
    #[arg(long, default_value_t = DEFAULT_TILE, value_name = "PIXELS")]
    pub tile: usize,
    /// Samples per pixel between two verdicts on a tile.
    #[arg(long, default_value_t = 100, value_name = "SPP")]
    pub batch: u64,
    /// When tiles are judged: after `every` batch, or `spaced` by the expected need, in multiples of the batch.
    #[arg(long, value_enum, default_value_t = ScheduleChoice::Every)]
    pub schedule: ScheduleChoice,
    /// No tile stops before [default: the batch].
    #[arg(long, value_name = "SPP")]
    pub min_spp: Option<u64>,
    /// Every tile stops at so many samples per pixel [default: 10000; N with --criterion spp:N].
    #[arg(long, value_name = "SPP")]
    pub max_spp: Option<u64>,
    /// Stop all tiles after so many seconds of sampling.
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub time: Option<std::time::Duration>,
    /// Verdicts in a row that have to say "converged".
    #[arg(long, default_value_t = 1, value_name = "K")]
    pub consecutive: u32,
    /// Whose eyes: `observers` (of the training data), `art-students` (T' = 1.94 T - 346), or a line `a,b` for T' = a T + b.
    #[arg(long, default_value = "observers", value_parser = parse_audience)]
    pub audience: Audience,
    /// Converged picture of the same size to compare with: relMSE in timeline.csv and report.json.
    #[arg(long, value_name = "FILE.exr")]
    pub against: Option<PathBuf>,
    /// Refresh the files in the output folder every so many seconds while rendering; 0 for never.
    #[arg(long, default_value = "30", value_name = "SECONDS", value_parser = parse_pause)]
    pub autosave: std::time::Duration,
    /// Go on with the render that the output folder holds, if it was broken off by Ctrl-C, --time or a kill: the picture and its stops are then
    /// those of a render that was not. Scene and options must be the same. With the built-in renderer, and the oracle or `spp:N`.
    #[arg(long)]
    pub resume: bool,
    /// No progress bar and no summary.
    #[arg(long, short)]
    pub quiet: bool,
}

/// Render the quick noise-free reference of a scene: direct light, and what mirrors and glass show of it.
///
/// This is the ray-traced picture that Takouachet et al. hold a noisy one against. Each part takes samples until its own noise is far
/// below what people see. What was scattered on its way by a diffuse surface is missing, so it is no converged picture.
///
/// A corpus that has one as reference.exr beside its pictures can be learned and scored with `--evidence reference`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor reference glass-spheres --size 512x512
  noisefloor reference hall/scene.xml --out corpus/hall/reference.exr
  noisefloor evaluate --corpus corpus --evidence reference")]
pub struct ReferenceArgs {
    /// Scene, as for `render`.
    #[arg(value_name = "SCENE")]
    pub scene: String,
    #[command(flatten)]
    pub renderer: RendererArgs,
    /// The picture, in linear light; what it looks like is written beside it, as PNG [default: out/SCENE-reference.exr].
    #[arg(long, value_name = "FILE.exr")]
    pub out: Option<PathBuf>,
    /// No progress bar and no summary.
    #[arg(long, short)]
    pub quiet: bool,
}

/// Let stopping criteria watch one render, and compare what each costs and what it leaves.
///
/// Each scene is rendered once, uniformly. Every criterion sees the same samples and takes those of a tile until it stops it: what it took,
/// what that cost, and how far its picture is from the converged one (relMSE, PSNR, FLIP, butteraugli) is set beside uniform sampling.
///
/// Criteria: `oracle`; `spp:N`; `relative-error`, `dammertz`, `cycles`, `luxcore`, `vdp-stages`, `vdp-first`, each with a constant of its
/// own (`cycles:0.02`) or with a default: Blender's 0.01 for `cycles`, and the one that agrees with people on average for the others.
///
/// Writes into the output folder: index.html with all of it (one file, opens without a server), runs.csv, runs.json, and for each scene
/// curve.csv, tiles.csv, plots (SVG and PNG), crops with error maps, every criterion's picture, and the reference, which the next
/// comparison of the same scene uses again.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor compare cornell-box glass-spheres --size 256x256 --tile 64
  noisefloor compare hall/scene.xml --reference hall.exr --criteria oracle,cycles:0.01,dammertz
  noisefloor compare cornell-box --criteria oracle,cycles,dammertz --sweep 6    the rivals at six strictnesses each
  noisefloor compare hall/scene.xml --source mitsuba --max-spp 1000")]
pub struct CompareArgs {
    /// Scenes, as for `render`.
    #[arg(required = true, value_name = "SCENE")]
    pub scenes: Vec<String>,
    #[command(flatten)]
    pub renderer: RendererArgs,
    /// Output folder.
    #[arg(long, value_name = "DIR", default_value = "out/compare")]
    pub out: PathBuf,
    /// The criteria; plots have a colour for each.
    #[arg(
        long,
        value_name = "NAME[:CONSTANT],…",
        value_delimiter = ',',
        default_value = "oracle,relative-error,dammertz,cycles,luxcore,vdp-stages,vdp-first"
    )]
    pub criteria: Vec<String>,
    /// Each criterion that is given without a constant also at so many others, from strict to lax.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=50))]
    pub sweep: u32,
    #[command(flatten)]
    pub oracle: OracleArgs,
    #[command(flatten)]
    pub tone: ToneArgs,
    /// Tile edge in pixels, 16…512.
    #[arg(long, default_value_t = DEFAULT_TILE, value_name = "PIXELS")]
    pub tile: usize,
    /// Samples per pixel between two verdicts on a tile.
    #[arg(long, default_value_t = 100, value_name = "SPP")]
    pub batch: u64,
    /// The run ends at so many samples per pixel, whoever is not satisfied.
    #[arg(long, value_name = "SPP", default_value_t = 2000)]
    pub max_spp: u64,
    /// The converged picture, in linear light [default: rendered with --reference-spp].
    #[arg(long, value_name = "FILE.exr")]
    pub reference: Option<PathBuf>,
    /// Samples per pixel of a reference that is rendered.
    #[arg(long, value_name = "SPP", default_value_t = 8000)]
    pub reference_spp: u64,
    /// How far people are from the screen, for FLIP: pixels in a degree of their view.
    #[arg(long, value_name = "N", default_value_t = 67.0)]
    pub pixels_per_degree: f64,
    /// No progress bar and no table.
    #[arg(long, short)]
    pub quiet: bool,
}

/// Say of each tile of a picture whether people would see noise in it.
///
/// Noise shows where two renderings of one scene differ, so a second picture is needed: same view, other samples. Several are
/// pooled. The verdict is on IMAGE alone: its noise is worked out from the difference and the numbers of samples. PNGs are judged as
/// they are shown; EXRs are tone mapped first.
///
/// Two stages of one progressive rendering share samples. Where that can be told from the pictures it is taken into account, and said;
/// --nested and --independent decide it.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor judge a.exr --spp 256 --against b.exr --spp 256       two independent renderings
  noisefloor judge 00100.png --spp 100 --against 00900.png --spp 900 --nested --heat-map verdict.png
  noisefloor judge a.exr --spp 64 --against b.exr --spp 64 --noise-map noise.png
  noisefloor judge a.exr --spp 64 --against b.exr --spp 64 --json > verdicts.json")]
pub struct JudgeArgs {
    /// Picture to judge, PNG or EXR.
    #[arg(value_name = "IMAGE")]
    pub image: PathBuf,
    /// Samples per pixel: first of IMAGE, then of each --against, in their order.
    #[arg(long, required = true, value_name = "N")]
    pub spp: Vec<f64>,
    /// Another rendering of the same view. Repeat for more.
    #[arg(long, required = true, value_name = "IMAGE")]
    pub against: Vec<PathBuf>,
    /// The pictures are stages of one progressive rendering: the smaller one's samples are in the larger one.
    #[arg(long)]
    pub nested: bool,
    /// The pictures share no samples, whatever they look like.
    #[arg(long, conflicts_with = "nested")]
    pub independent: bool,
    #[command(flatten)]
    pub oracle: OracleArgs,
    #[command(flatten)]
    pub tone: ToneArgs,
    /// Tile edge in pixels, 16…512.
    #[arg(long, default_value_t = DEFAULT_TILE, value_name = "PIXELS")]
    pub tile: usize,
    /// Print JSON instead of a table.
    #[arg(long)]
    pub json: bool,
    /// Write the probabilities as a heat map over the picture.
    #[arg(long, value_name = "FILE.png")]
    pub heat_map: Option<PathBuf>,
    /// Write a map of the visible noise, block by block of 8x8 pixels, over the picture.
    #[arg(long, value_name = "FILE.png")]
    pub noise_map: Option<PathBuf>,
    /// Write the picture as linear EXR, with probability and visible noise (in 8-bit steps) as channels.
    #[arg(long, value_name = "FILE.exr")]
    pub exr: Option<PathBuf>,
}

/// Judge pictures of your own in the browser, disagree, and retrain.
///
/// Drop renderings of one view on the page, or name them here: two with different seeds, stages of one rendering, or a picture and its
/// converged reference (PNG, EXR or PFM). It shows what `judge` says of each tile, a map of visible noise and the samples predicted; threshold and
/// audience move under the slider. A click on a tile says that the verdict is wrong, and is kept in the database before it is acknowledged;
/// `train --disagreements`, or the page itself with --table, learns from that. For this machine alone: nothing leaves it.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor explore                                         then drop pictures on http://127.0.0.1:8438
  noisefloor explore 00100.png 00400.png 01600.png           a stack, named by its samples per pixel
  noisefloor explore a_256spp.exr b_256spp.exr --table fixtures/human-table.csv      and retrain on the page
  noisefloor train --table fixtures/human-table.csv --disagreements explore.sqlite --out mine.nfm")]
pub struct ExploreArgs {
    /// Pictures to begin with. Names like 00100.png or hall_64spp.exr say how many samples per pixel they have; the page asks for others.
    #[arg(value_name = "IMAGE")]
    pub images: Vec<PathBuf>,
    #[command(flatten)]
    pub oracle: OracleArgs,
    /// Whose eyes: `observers`, `art-students`, or a,b for T' = a T + b.
    #[arg(long, default_value = "observers", value_name = "WHO", value_parser = parse_audience)]
    pub audience: Audience,
    /// Tile edge in pixels, 16…512.
    #[arg(long, default_value_t = DEFAULT_TILE, value_name = "PIXELS", value_parser = parse_edge)]
    pub tile: usize,
    /// Where disagreements are kept; made if it is not there.
    #[arg(long, default_value = "explore.sqlite", value_name = "FILE")]
    pub database: PathBuf,
    /// Table of human thresholds that the page retrains on, such as the project's fixtures/human-table.csv, or one that `train --save-table`
    /// wrote. Without, the page cannot retrain.
    #[arg(long, value_name = "FILE.csv")]
    pub table: Option<PathBuf>,
    /// Address and port to listen on; port 0 takes a free one. Pictures travel unencrypted: only in a network that you trust.
    #[arg(long, default_value = "127.0.0.1:8438", value_name = "IP:PORT")]
    pub listen: std::net::SocketAddr,
    /// Another name of this machine by which browsers ask for it. Repeat for more.
    #[arg(long, value_name = "HOST")]
    pub allow_host: Vec<String>,
}

/// Train a model on human thresholds.
///
/// A corpus is a folder with thresholds.csv (scene, renderer, zone, x, y, width, height, human_spp, first_spp, last_spp) and the
/// pictures: SCENE/SPP.png, running means of one progressive rendering, or zoneNN/batch_FIRST_LAST.exr, means of those
/// samples alone. C and γ are chosen, and probabilities calibrated, by leaving out one scene at a time.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor train --corpus study/lisic9 --corpus study/staircase --out my.nfm
  noisefloor train --table fixtures/human-table.csv --out my.nfm    from the table that ships, without any picture
  noisefloor train --table fixtures/human-table.csv --disagreements explore.sqlite --out my.nfm")]
pub struct TrainArgs {
    #[command(flatten)]
    pub data: DataArgs,
    /// Model file to write.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Also write the table of descriptors, from which `--table` trains without the pictures.
    #[arg(long, value_name = "FILE.csv")]
    pub save_table: Option<PathBuf>,
    /// Learn from disagreements too, which `explore` has kept in this database: each counts as much as the levels of a zone within a doubling of samples. Scores before and after are
    /// printed.
    #[arg(long, value_name = "FILE.sqlite", conflicts_with = "no_scores")]
    pub disagreements: Option<PathBuf>,
    /// Do not score on left-out scenes (the scores are then missing from the model's record).
    #[arg(long)]
    pub no_scores: bool,
    #[command(flatten)]
    pub search: SearchArgs,
}

/// Score predicted thresholds against human ones.
///
/// Predicts for each zone the samples per pixel at which P crosses the threshold, and compares with what people said: error factor
/// exp(mean |ln ratio|), bias factor, share stopped below half the human threshold; beside it a constant noise level and the median of
/// the same scene's other zones. Levels between the pictures given are synthesised (noise ∝ 1/√n); the accuracy on images counts
/// real ones alone.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor evaluate --table fixtures/human-table.csv --leave-one-scene-out
  noisefloor evaluate --corpus study/mine --model my.nfm --json scores.json --csv zones.csv
  noisefloor evaluate --corpus study/mine --leave-one-scene-out --figures out/scores
  noisefloor evaluate --table fixtures/human-table.csv --leave-one-scene-out --without picture_noise")]
pub struct EvaluateArgs {
    #[command(flatten)]
    pub data: DataArgs,
    /// Model to score [default: the bundled one, which has seen the zones it was trained on].
    #[arg(long, value_name = "FILE", conflicts_with = "leave_one_scene_out")]
    pub model: Option<PathBuf>,
    /// Predict each scene by a model that has not seen it, nor another view of its room.
    #[arg(long)]
    pub leave_one_scene_out: bool,
    /// Probability from which a tile counts as converged.
    #[arg(long, default_value_t = Threshold::PAPER, value_name = "P")]
    pub threshold: Threshold,
    /// Write scores as JSON.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Write each zone's thresholds as CSV: scene,zone,human_spp,predicted_spp,censored,unfamiliar.
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Draw into this folder: both thresholds of each zone (over the pictures, with --corpus), one against the other, and the
    /// reliability of P.
    #[arg(long, value_name = "DIR")]
    pub figures: Option<PathBuf>,
    /// Leave numbers out of the descriptor, by their names in the table, to see what they are worth.
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', requires = "leave_one_scene_out")]
    pub without: Vec<String>,
    /// Also score what people use instead: other stopping criteria, by the names of `noisefloor compare --help`, the constant of each
    /// fitted on the other scenes. Minutes each; the visible-differences predictors, an hour. With --figures, draws mean thresholds
    /// scene by scene.
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', requires = "corpus", value_parser = parse_rival)]
    pub rivals: Vec<&'static Rival>,
    #[command(flatten)]
    pub search: SearchArgs,
}

/// Work out how much harder than the observers of a model other people look.
#[derive(Debug, Args)]
pub struct AudienceArgs {
    #[command(subcommand)]
    pub command: AudienceCommand,
}

#[derive(Debug, Subcommand)]
pub enum AudienceCommand {
    Fit(FitArgs),
}

/// Fit the line T' = a T + b from the thresholds T of the observers to those of an audience, T'.
///
/// Show your audience zones for which thresholds of the observers are known, or that a model predicts. FILE.csv has a line a zone, and
/// the columns `observers` and `audience`, in samples per pixel; others are passed over. Prints the line (median of slopes, which
/// bears outliers), Pearson's r, 95 % intervals of a and b by bootstrap, and what to give to `render`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  noisefloor audience fit students.csv
  noisefloor render --audience 1.94,-346")]
pub struct FitArgs {
    /// Pairs of thresholds.
    #[arg(value_name = "FILE.csv")]
    pub file: PathBuf,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// Ask people: collect thresholds in the browser, validate what a model says, and train on the answers.
///
/// STUDY.toml names stacks of pictures (folders of NNNNN.png or NNNNN.exr, by samples per pixel), the protocol, and what observers read
/// and agree to; docs/study.md explains it.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  noisefloor study serve hall.toml
  noisefloor study simulate hall.toml --observers 12      a rehearsal, kept apart from people's answers
  noisefloor study analyse hall.toml --out out/hall
  noisefloor train --corpus out/hall/corpus --corpus another-study --out my.nfm")]
pub struct StudyArgs {
    #[command(subcommand)]
    pub command: StudyCommand,
}

#[derive(Debug, Subcommand)]
pub enum StudyCommand {
    Serve(ServeArgs),
    Analyse(AnalyseArgs),
    Simulate(SimulateArgs),
    Links(LinksArgs),
    Data(DataFolderArgs),
    Backup(BackupArgs),
    /// Print all that is kept of one observer, as JSON.
    Export(ObserverArgs),
    /// Erase all that is kept of one observer, for good.
    Erase(ObserverArgs),
}

/// Serve the pages of a study until Ctrl-C.
///
/// For this machine alone unless --listen says otherwise. Every answer is on disk before it is acknowledged; the server may be killed
/// and started again at any time.
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// Address to listen on. Answers travel unencrypted: only in a network that you trust.
    #[arg(long, value_name = "IP", default_value = "127.0.0.1")]
    pub listen: std::net::IpAddr,
    /// Port; 0 takes a free one.
    #[arg(long, default_value_t = 8437)]
    pub port: u16,
    /// Another name by which browsers ask for this server. Repeat for more.
    #[arg(long, value_name = "HOST")]
    pub allow_host: Vec<String>,
    /// Believe X-Forwarded-For and X-Forwarded-Proto of a proxy at this address. Repeat for more.
    #[arg(long, value_name = "IP")]
    pub trust_proxy: Vec<std::net::IpAddr>,
    /// Path that the proxy passes on, for example /noise.
    #[arg(long, value_name = "PATH", default_value = "")]
    pub base_path: String,
}

/// Make one-time links, each for one participant.
#[derive(Debug, Args)]
pub struct LinksArgs {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// How many.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub count: u32,
    /// Address of the study as participants open it.
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:8437/")]
    pub url: String,
}

/// Write every response as data for others: one long table, and a BIDS-like folder with a data dictionary.
#[derive(Debug, Args)]
pub struct DataFolderArgs {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// Folder to write into.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Write the responses of simulated observers instead of people.
    #[arg(long)]
    pub simulated: bool,
}

/// Copy the database of a study, also while it is being served. To restore it, put the copy in its place.
#[derive(Debug, Args)]
pub struct BackupArgs {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// The copy, which must not exist yet.
    #[arg(value_name = "FILE")]
    pub to: PathBuf,
}

/// Analyse the answers: thresholds of tiles, agreement, groups, Table 2 of the paper, plots, and a corpus for `train`.
#[derive(Debug, Args)]
pub struct AnalyseArgs {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// Folder to write into.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Threshold of a tile in the corpus and in the grid over the picture.
    #[arg(long, value_enum, default_value_t = ThresholdChoice::Level95)]
    pub threshold: ThresholdChoice,
    /// Keep observers whom the rules of the study exclude.
    #[arg(long)]
    pub keep_excluded: bool,
    /// Analyse simulated observers instead of people.
    #[arg(long)]
    pub simulated: bool,
    /// Seed of the bootstrap.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// What the threshold of a tile is.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum ThresholdChoice {
    /// Where 95 % of observers see no difference.
    Level95,
    /// The mean over observers.
    Mean,
}

/// Rehearse a study: simulated observers, with made-up thresholds, answer it through a real server. Their answers are kept apart from
/// people's.
#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// How many.
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub observers: u16,
    /// Seed: the same seed draws the same observers.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// One observer.
#[derive(Debug, Args)]
pub struct ObserverArgs {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// The participant's code.
    #[arg(value_name = "CODE")]
    pub code: String,
}

/// Repeat the paper's own experiment on human corpora, at its scale, and report what comes out.
///
/// The paper (Takouachet et al. 2017, §4.3 to §5) trains on pairs: a noisy tile and its reference, 128×128 pixels each, with C = 2 and
/// γ = 2. On luminances it failed (P ≈ 23 %), on noise masks 97.98 % were told right. Here both, with values as displayed and
/// standardised, asked about the pairs that were learned, a fifth held out, the other half of the scenes, and each scene left out.
///
/// With the eight scenes of the human data: 128 zones × 75 levels = 9,600 pairs of 32,768 numbers, 5 GB of memory, some twenty minutes on two cores.
/// Every result is written whole as soon as it is there; after Ctrl-C (exit code 130) the same command goes on from there. All is
/// together in reproduce.json and reproduce.md when it is done.
///
/// Levels are synthesised between the images given (noise ∝ 1/√n), and real images scored apart. Pictures are held
/// against SCENE/reference.exr; without, the most converged image stands in for the ray-traced reference of the paper.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor reproduce --corpus study/lisic9 study/staircase
  noisefloor reproduce --corpus study/lisic9 study/staircase --dump-subset 1000 --out subset")]
pub struct ReproduceArgs {
    /// Corpus folders, as for `train`.
    #[arg(long, value_name = "DIR", num_args = 1.., required = true)]
    pub corpus: Vec<PathBuf>,
    /// Output folder.
    #[arg(long, value_name = "DIR", default_value = "out/reproduce")]
    pub out: PathBuf,
    /// Edge of the tiles in pixels: each is the centre of its zone.
    #[arg(long, value_name = "PIXELS", default_value_t = DEFAULT_TILE, value_parser = parse_edge)]
    pub edge: usize,
    /// Levels a zone, with equal steps up to its most converged image, 10…1000. The paper has 100.
    #[arg(long, value_name = "N", default_value_t = 75, value_parser = parse_levels)]
    pub levels: usize,
    /// Instead of all this: learn N of the mask pairs, as displayed, and write them (rows.npy) with the decision values of as
    /// many others (machine.json), to compare with other programs.
    #[arg(long, value_name = "N", value_parser = parse_count)]
    pub dump_subset: Option<usize>,
}

/// Show what a model depends on and where it comes from.
#[derive(Debug, Args)]
pub struct InspectArgs {
    /// Model file [default: the bundled model].
    #[arg(value_name = "MODEL")]
    pub model: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// Say which other renderers can be used here and what is missing, or install one.
///
/// A renderer is used from the Python that NOISEFLOOR_NAME_PYTHON names (as NOISEFLOOR_MITSUBA_PYTHON), else from a private
/// environment in the cache folder, which --install makes with pinned packages. The exit code is 1 if one that is there does not load;
/// not to be installed is no fault.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor doctor
  noisefloor doctor --install mitsuba                 or luxcore, or cycles")]
pub struct DoctorArgs {
    /// Install this renderer, if it is not there yet.
    #[arg(long, value_name = "RENDERER", value_parser = parse_adapter)]
    pub install: Option<&'static Adapter>,
}

/// Where the human thresholds are.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub struct DataArgs {
    /// Corpus folders.
    #[arg(long, value_name = "DIR", num_args = 1..)]
    pub corpus: Vec<PathBuf>,
    /// Table of descriptors, written by `train --save-table`.
    #[arg(long, value_name = "FILE.csv")]
    pub table: Option<PathBuf>,
}

/// How to train.
#[derive(Debug, Args)]
pub struct SearchArgs {
    /// σ of the noise mask, 0.3…1.5 pixels (for --corpus; a table has its own).
    #[arg(long, default_value_t = 1.0)]
    pub sigma: f32,
    /// What pictures are held against (for --corpus; a table has its own).
    #[arg(long, value_enum, default_value_t = EvidenceChoice::Halves)]
    pub evidence: EvidenceChoice,
    /// Values of C to choose from [default: a grid].
    #[arg(long, value_delimiter = ',', value_name = "C,…")]
    pub c: Vec<f64>,
    /// Values of γ to choose from [default: a grid].
    #[arg(long, value_delimiter = ',', value_name = "G,…")]
    pub gamma: Vec<f64>,
}

/// Who renders, and how.
#[derive(Clone, Debug, Args)]
pub struct RendererArgs {
    /// Who renders: `ptwne`, the built-in path tracer; `mitsuba`, `cycles`, `luxcore` (path tracing), `luxcore-sobol`,
    /// `luxcore-metropolis` or `luxcore-bidir`, which `noisefloor doctor` sets up; `exr`, which plays a folder of pictures back; or `command: PROGRAM …`, any program that renders into an EXR or PFM file, with {scene} {seed} {spp} {out}, and {x0} {x1}
    /// {y0} {y1} if it can render tiles (x1 and y1 are exclusive).
    #[arg(long, default_value = "ptwne", value_name = "SOURCE", value_parser = parse_source)]
    pub source: SourceChoice,
    /// With another renderer: give it up if a call takes so many seconds.
    #[arg(long, default_value = "1800", value_name = "SECONDS", value_parser = parse_seconds)]
    pub timeout: std::time::Duration,
    /// Image size in pixels [default: what the scene file says, else 384x384; what a command renders].
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<(usize, usize)>,
    /// Seed of the random numbers: same seed, same image and same stops, whatever the number of threads (of the built-in path tracer; not
    /// every renderer promises it).
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Threads [default: one a core].
    #[arg(long)]
    pub threads: Option<NonZeroUsize>,
    /// Longest path, in segments: 1 is light seen directly, 2 is direct light [default: what the scene file says, else 65].
    #[arg(long, value_name = "N")]
    pub max_depth: Option<u32>,
    /// Built-in renderer: without multiple importance sampling, the plain path tracing with next event estimation of the paper.
    #[arg(long)]
    pub no_mis: bool,
    /// Built-in renderer: how the samples of a pixel are spread. The model was trained on independent ones [default: independent].
    #[arg(long, value_enum)]
    pub sampler: Option<SamplerChoice>,
    /// Built-in renderer: how pixels weigh the light around them [default: box].
    #[arg(long, value_enum)]
    pub filter: Option<FilterChoice>,
    /// Built-in renderer: scale samples down whose largest channel is brighter than this. Takes away fireflies, and light; how often
    /// is in report.json [default: never].
    #[arg(long, value_name = "RADIANCE")]
    pub clamp: Option<f32>,
}

/// Which oracle.
#[derive(Debug, Args)]
pub struct OracleArgs {
    /// Model file [default: the bundled model].
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Probability, that an observer sees no difference, from which a tile counts as converged.
    #[arg(long, default_value_t = Threshold::PAPER, value_name = "P")]
    pub threshold: Threshold,
}

/// The way from radiance to the screen.
#[derive(Debug, Args)]
pub struct ToneArgs {
    /// Tone mapping of linear pictures.
    #[arg(long, value_enum, default_value_t = ToneChoice::Reinhard)]
    pub tone_mapping: ToneChoice,
    /// Reinhard: what the log-average luminance becomes.
    #[arg(long, default_value_t = DEFAULT_KEY)]
    pub key: f32,
    /// Reinhard: smallest luminance, after exposure, that becomes white [default: compress without burning out].
    #[arg(long)]
    pub white: Option<f32>,
    /// sRGB: factor on radiance.
    #[arg(long, default_value_t = 1.0)]
    pub exposure: f32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum EvidenceChoice {
    /// The other half buffer: no reference is needed.
    Halves,
    /// A noise-free reference: of a corpus, SCENE/reference.exr, else the most converged picture stands in for it.
    Reference,
    /// Nothing but the picture itself. For comparison.
    Alone,
}

impl From<EvidenceChoice> for Evidence {
    fn from(choice: EvidenceChoice) -> Self {
        match choice {
            EvidenceChoice::Halves => Self::Halves,
            EvidenceChoice::Reference => Self::Reference,
            EvidenceChoice::Alone => Self::Alone,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ToneChoice {
    /// Reinhard et al. 2002, global operator.
    Reinhard,
    /// Multiply, clamp, encode.
    Srgb,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SamplerChoice {
    /// Each sample on its own.
    Independent,
    /// Owen-scrambled Sobol points: less noise, but of a kind that the model has not seen.
    Sobol,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FilterChoice {
    /// The pixel itself.
    Box,
    /// A tent over two pixels.
    Tent,
    /// A Gaussian with a standard deviation of half a pixel.
    Gaussian,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ScheduleChoice {
    Every,
    Spaced,
}

#[derive(Clone, Debug)]
pub enum SourceChoice {
    Ptwne,
    Exr,
    /// A template.
    Command(String),
    Adapter(&'static Adapter),
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CriterionChoice {
    Oracle,
    Fixed(u64),
    /// A specification that is known to be right.
    Rival(String),
}

fn parse_source(text: &str) -> Result<SourceChoice, String> {
    match text {
        "ptwne" => Ok(SourceChoice::Ptwne),
        "exr" => Ok(SourceChoice::Exr),
        _ => match text.strip_prefix("command:") {
            Some(template) => Ok(SourceChoice::Command(template.trim().to_owned())),
            None => parse_adapter(text)
                .map(SourceChoice::Adapter)
                .map_err(|known| format!("{known}; or `ptwne`, `exr`, or `command: PROGRAM …`")),
        },
    }
}

fn parse_adapter(text: &str) -> Result<&'static Adapter, String> {
    let names = || ADAPTERS.iter().map(|adapter| adapter.name).collect::<Vec<_>>().join(", ");
    let found = ADAPTERS.iter().find(|adapter| adapter.name == text);
    found.ok_or_else(|| format!("the other renderers are: {}", names()))
}

fn parse_rival(text: &str) -> Result<&'static Rival, String> {
    let names = || RIVALS.iter().map(|rival| rival.name).collect::<Vec<_>>().join(", ");
    RIVALS.iter().find(|rival| rival.name == text).ok_or_else(|| format!("the rivals are: {}", names()))
}

fn parse_size(text: &str) -> Result<(usize, usize), String> {
    let parts = text.split_once(['x', 'X', '×']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    let (width, height) = parts.ok_or("expected WIDTHxHEIGHT in pixels, such as 512x512")?;
    noisefloor::check_image(width, height).map_err(|e| e.to_string())?;
    Ok((width, height))
}

/// A whole number within a range, or what it should have been.
fn parse_within(text: &str, range: std::ops::RangeInclusive<usize>) -> Result<usize, String> {
    let number = text.parse().ok().filter(|n| range.contains(n));
    number.ok_or_else(|| format!("expected a whole number within {}…{}", range.start(), range.end()))
}

fn parse_edge(text: &str) -> Result<usize, String> {
    parse_within(text, MIN_TILE..=MAX_TILE)
}

fn parse_levels(text: &str) -> Result<usize, String> {
    parse_within(text, 10..=1000)
}

fn parse_count(text: &str) -> Result<usize, String> {
    parse_within(text, 2..=100_000)
}

fn parse_criterion(text: &str) -> Result<CriterionChoice, String> {
    match text.split_once(':') {
        None if text == "oracle" => Ok(CriterionChoice::Oracle),
        Some(("spp", n)) => match n.parse() {
            Ok(n) if n > 0 => Ok(CriterionChoice::Fixed(n)),
            _ => Err(format!("spp:{n} needs a positive whole number of samples, such as spp:1000")),
        },
        _ => match noisefloor_rivals::parse(text) {
            Ok(_) => Ok(CriterionChoice::Rival(text.to_owned())),
            Err(error) => Err(format!("{error}; or `oracle`")),
        },
    }
}

fn parse_audience(text: &str) -> Result<Audience, String> {
    match text {
        "observers" => Ok(Audience::TRAINED),
        "art-students" => Ok(Audience::ART_STUDENTS),
        line => {
            let parts = line
                .split_once(',')
                .and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)));
            let (slope, offset) =
                parts.ok_or("expected `observers`, `art-students`, or a,b for T' = a T + b")?;
            Ok(Audience { slope, offset })
        }
    }
}

fn parse_seconds(text: &str) -> Result<std::time::Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected seconds, such as 60 or 0.5")?;
    if seconds.is_nan() || seconds <= 0.0 {
        return Err("expected a time above 0 seconds".into());
    }
    std::time::Duration::try_from_secs_f64(seconds).map_err(|e| e.to_string())
}

fn parse_pause(text: &str) -> Result<std::time::Duration, String> {
    if text.parse() == Ok(0.0) { Ok(std::time::Duration::ZERO) } else { parse_seconds(text) }
}

impl ToneArgs {
    /// The tone mapping, checked.
    pub fn check(&self) -> anyhow::Result<ToneMapping> {
        let tone = match self.tone_mapping {
            ToneChoice::Reinhard => ToneMapping::Reinhard { key: self.key, white: self.white },
            ToneChoice::Srgb => ToneMapping::Srgb { exposure: self.exposure },
        };
        tone.check()?;
        Ok(tone)
    }
}

impl OracleArgs {
    /// The oracle, loaded and checked.
    pub fn load(&self) -> anyhow::Result<Oracle> {
        Ok(Oracle::new(load_model(self.model.as_deref())?, self.threshold))
    }
}

/// Reads a model file, or the bundled model.
pub fn load_model(path: Option<&Path>) -> anyhow::Result<Model> {
    let Some(path) = path else { return Ok(Model::bundled()) };
    let file = File::open(path).with_context(|| format!("{}: cannot be opened", path.display()))?;
    Model::read(BufReader::new(file)).with_context(|| format!("{}", path.display()))
}

impl RendererArgs {
    /// Makes the pool of threads that was asked for.
    pub fn set_threads(&self) -> anyhow::Result<()> {
        if let Some(threads) = self.threads {
            rayon::ThreadPoolBuilder::new().num_threads(threads.get()).build_global().context("--threads")?;
        }
        Ok(())
    }
}

impl RenderArgs {
    /// Session parameters, checked.
    pub fn params(&self) -> anyhow::Result<Params> {
        let schedule = match self.schedule {
            ScheduleChoice::Every => Schedule::Every { step: self.batch },
            ScheduleChoice::Spaced => Schedule::Spaced { step: self.batch },
        };
        let max_spp = match &self.criterion {
            CriterionChoice::Oracle | CriterionChoice::Rival(_) => {
                self.max_spp.unwrap_or(Params::default().max_spp)
            }
            // Exactly so many, not the next multiple of the batch.
            CriterionChoice::Fixed(samples) => self.max_spp.map_or(*samples, |most| most.min(*samples)),
        };
        let params = Params {
            tile: self.tile,
            tone_mapping: self.tone.check()?,
            schedule,
            min_spp: self.min_spp.unwrap_or(0),
            max_spp,
            consecutive: self.consecutive,
            audience: self.audience,
        };
        params.check()?;
        Ok(params)
    }
}
