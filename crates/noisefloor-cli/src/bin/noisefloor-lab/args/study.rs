//! `noisefloor-lab study`.

use clap::{Args, Subcommand, ValueEnum};
use noisefloor_cli::options::renderer::RendererArgs;
use std::ffi::OsString;
use std::net::IpAddr;
use std::path::PathBuf;

/// Ask people: collect thresholds in the browser, check what a model says, and train on the answers.
///
/// STUDY.toml names stacks of pictures (folders of NNNNN.png or NNNNN.exr, named by samples per pixel), the
/// protocol, and the texts that observers read and agree to. docs/studies.md explains it.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor-lab study stack cornell-box --size 256x256 --out stacks/cornell-box
  noisefloor-lab study stack cornell-box --size 256x256 --denoise oidn --out stacks/denoised-cornell-box
  noisefloor-lab study serve hall.toml
  noisefloor-lab study simulate hall.toml --observers 12      a rehearsal, kept apart from people's answers
  noisefloor-lab study analyse hall.toml --out out/hall
  noisefloor-lab train --corpus out/hall/corpus --corpus another-study --out my.nfm")]
pub struct StudyArgs {
    #[command(subcommand)]
    pub command: StudyCommand,
}

#[derive(Debug, Subcommand)]
pub enum StudyCommand {
    Stack(StackArgs),
    Serve(ServeArgs),
    Analyse(AnalyseArgs),
    Simulate(SimulateArgs),
    Links(LinksArgs),
    Data(DataFolderArgs),
    Backup(BackupArgs),
    /// Print everything that is stored about one observer, as JSON.
    Export(ObserverArgs),
    /// Erase everything that is stored about one observer, for good.
    Erase(ObserverArgs),
}

/// Render a stack of pictures for a study in one go: each level goes on from the one before.
#[derive(Debug, Args)]
pub struct StackArgs {
    /// Scene, as for `render`.
    #[arg(value_name = "SCENE")]
    pub scene: OsString,
    #[command(flatten)]
    pub renderer: RendererArgs,
    /// Samples per pixel of the levels, increasing; the last one is the reference. By default each has 1.35 times the
    /// samples of the one before, with which intervals were tried; with coarser levels they are wrong more often.
    #[arg(
        long,
        value_name = "N,…",
        value_delimiter = ',',
        default_value = "8,11,15,20,27,36,48,65,88,119,161,217,293,396,534,721,974,1315,1775,2396"
    )]
    pub levels: Vec<u64>,
    /// Denoise every level but the last, the reference: `oidn` is Open Image Denoise (`noisefloor doctor
    /// --install oidn`). Or name any program: {in} is the EXR that it reads, {out} the path, without
    /// extension, of the EXR or PFM that it writes. Thresholds of such pictures hold for this denoiser; a
    /// model cannot learn from them.
    #[arg(long, value_name = "oidn|PROGRAM …")]
    pub denoise: Option<String>,
    /// Folder to write the levels into, as linear EXRs.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Serve the pages of a study until Ctrl-C.
///
/// Only this machine can reach the server unless --listen says otherwise. Every answer is on disk before it
/// is acknowledged, so the server may be killed and restarted at any time.
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// Address to listen on. Answers travel unencrypted: use it only in a network that you trust.
    #[arg(long, value_name = "IP", default_value = "127.0.0.1")]
    pub listen: IpAddr,
    /// Port; 0 picks a free one.
    #[arg(long, default_value_t = 8437)]
    pub port: u16,
    /// Another name that browsers may use for this server. Repeat for more.
    #[arg(long, value_name = "HOST")]
    pub allow_host: Vec<String>,
    /// Trust X-Forwarded-For and X-Forwarded-Proto from a proxy at this address. Repeat for more.
    #[arg(long, value_name = "IP")]
    pub trust_proxy: Vec<IpAddr>,
    /// Path under which the proxy serves the study, such as /noise.
    #[arg(long, value_name = "PATH", default_value = "")]
    pub base_path: String,
    /// Admit simulated observers, for a rehearsal with a program of your own: they need no link, get no
    /// completion code, and their answers are kept apart.
    #[arg(long)]
    pub admit_simulated: bool,
}

/// Make one-time links, one for each participant.
#[derive(Debug, Args)]
pub struct LinksArgs {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// Number of links.
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

/// Copy the database of a study, even while it is being served. To restore it, put the copy in its place.
#[derive(Debug, Args)]
pub struct BackupArgs {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// The copy, which must not exist yet.
    #[arg(value_name = "FILE")]
    pub to: PathBuf,
}

/// Analyse the answers: thresholds of tiles, agreement, the spread of people, groups, Table 2 of the paper, plots, and
/// a corpus for `train`.
#[derive(Debug, Args)]
pub struct AnalyseArgs {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// Folder to write into.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// The threshold of a tile in the corpus and in the grid over the picture. `train` expects the mean: P
    /// counts the scatter of observers around it.
    #[arg(long, value_enum, default_value_t = ThresholdChoice::Mean)]
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

/// Rehearse a study: simulated observers with made-up thresholds answer it through a real server. Their
/// answers are kept apart from people's.
#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// Number of observers.
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub observers: u16,
    /// Standard deviation of ln(threshold) between people in one place; about half of its variance is common to all
    /// tiles.
    #[arg(long, value_name = "SD", default_value_t = 0.5, value_parser = deviation)]
    pub spread: f64,
    /// Seed: the same seed draws the same observers.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

fn deviation(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|sd| (0.0..=3.0).contains(sd)).ok_or("it is a number from 0 to 3".into())
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
