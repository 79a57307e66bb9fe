//! `noisefloor calibrate`.

use crate::calibrate::{AskJob, CalibrateTask, Simulated};
use clap::Args;
use noisefloor_cli::refuse;
use noisefloor_eyes::Eyes;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Find out how many samples your own eyes need, on your display: two minutes, once.
///
/// People differ by more than models do, and so do displays. A page shows four pictures at a time, of which
/// one has noise: which one? About forty answers tell how many times the samples of the model's observers
/// you need, and how sure that is. From then on `render`, `judge` and `farm` stop where you see no noise, and
/// say so; --eyes none goes without. Whoever guesses is told so, and nothing is kept.
///
/// The server is for this machine: nothing leaves it.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor calibrate                              then open http://127.0.0.1:8440
  noisefloor calibrate --for anna --out studio.toml     several people in one file
  noisefloor render hall.xml --eyes studio.toml     so that nine of ten of them are content
  noisefloor calibrate --show
  noisefloor calibrate --simulate factor=1.7        an observer made of numbers, without a browser")]
pub struct CalibrateArgs {
    /// Say what was measured, and when.
    #[arg(long, conflicts_with_all = ["simulate", "listen", "allow_host", "person"])]
    show: bool,
    /// Name of the person: a file holds one entry for each.
    #[arg(long = "for", default_value = "me", value_name = "NAME")]
    person: String,
    /// File that is read or written [default: noisefloor/eyes.toml in the system's folder for settings].
    #[arg(long, value_name = "FILE.toml")]
    out: Option<PathBuf>,
    /// Calibrate a simulated observer, and keep nothing: factor=1.7, and if wanted scatter=0.2 (logistic scale
    /// in ln samples), slips=0.02 (share of answers without looking), seed=1.
    #[arg(long, value_name = "factor=F,…", conflicts_with_all = ["listen", "allow_host", "out"])]
    simulate: Option<String>,
    /// Address and port to listen on; port 0 picks a free one.
    #[arg(long, default_value = "127.0.0.1:8440", value_name = "IP:PORT")]
    listen: SocketAddr,
    /// Another name of this machine that browsers may use. Repeat for more.
    #[arg(long, value_name = "HOST")]
    allow_host: Vec<String>,
}

impl CalibrateArgs {
    pub fn check(self) -> anyhow::Result<CalibrateTask> {
        let Self { show, person, out, simulate, listen, allow_host } = self;
        let place = || out.map_or_else(Eyes::place, Ok);
        Ok(match simulate {
            _ if show => CalibrateTask::Show(place()?),
            Some(text) => CalibrateTask::Simulate(simulated(&text)?),
            None => CalibrateTask::Ask(AskJob { person, out: place()?, listen, allow_host }),
        })
    }
}

fn simulated(text: &str) -> anyhow::Result<Simulated> {
    let mut observer = Simulated { factor: f64::NAN, scatter: 0.2, slips: 0.02, seed: 1 };
    for part in text.split(',') {
        let (key, value) = part.split_once('=').unwrap_or((part, ""));
        let number = |[low, high]: [f64; 2]| -> anyhow::Result<f64> {
            match value.parse() {
                Ok(number) if (low..=high).contains(&number) => Ok(number),
                _ => refuse!("--simulate {key}={value}: expected a number within {low}…{high}"),
            }
        };
        match key {
            "factor" => observer.factor = number([0.05, 20.0])?,
            "scatter" => observer.scatter = number([0.0, 3.0])?,
            "slips" => observer.slips = number([0.0, 1.0])?,
            "seed" => observer.seed = number([0.0, 9e15])? as u64,
            _ => refuse!("--simulate {part}: expected factor, scatter, slips or seed, as in factor=1.7"),
        }
    }
    if observer.factor.is_nan() {
        refuse!("--simulate {text}: factor is missing, as in factor=1.7");
    }
    Ok(observer)
}
