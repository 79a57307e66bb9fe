//! `noisefloor calibrate`.

use noisefloor_cli::say::say;
use noisefloor_eyes::{Eyes, Person};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

/// An observer made of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Simulated {
    pub factor: f64,
    pub scatter: f64,
    pub slips: f64,
    pub seed: u64,
}

#[cfg_attr(not(feature = "watch"), allow(dead_code, reason = "refused without web server"))]
pub enum CalibrateTask {
    Show(PathBuf),
    Simulate(Simulated),
    Ask(AskJob),
}

/// Who is asked, and where that is kept.
#[cfg_attr(not(feature = "watch"), allow(dead_code, reason = "refused without web server"))]
pub struct AskJob {
    pub person: String,
    pub out: PathBuf,
    pub listen: SocketAddr,
    pub allow_host: Vec<String>,
}

pub fn run(task: CalibrateTask) -> anyhow::Result<()> {
    match task {
        CalibrateTask::Show(path) => show(&path),
        CalibrateTask::Simulate(observer) => page::simulate(observer),
        CalibrateTask::Ask(job) => page::ask(job),
    }
}

fn show(path: &Path) -> anyhow::Result<()> {
    if !path.exists() {
        say!("nobody is calibrated yet: {} is not there", path.display())?;
        return Ok(());
    }
    for Person { name, factor, interval: [low, high], answers, date, display, .. } in
        Eyes::read(path)?.people()
    {
        say!(
            "{name}: {factor:.2} times the samples of the model's observers (80 %: {low:.2} to {high:.2}), \
             by {answers} answers on {date}, at {:.0} pixels per degree",
            display.pixels_per_degree
        )?;
    }
    say!("in {}", path.display())?;
    Ok(())
}

/// In a build without web server.
#[cfg(not(feature = "watch"))]
mod page {
    use super::{AskJob, Simulated};
    use noisefloor_cli::refuse;

    pub(super) fn simulate(_: Simulated) -> anyhow::Result<()> {
        refuse!("{MISSING}")
    }

    pub(super) fn ask(_: AskJob) -> anyhow::Result<()> {
        refuse!("{MISSING}")
    }

    const MISSING: &str =
        "this build has no 'calibrate': run `cargo run --release --features watch -- calibrate …`";
}

#[cfg(feature = "watch")]
mod page {
    use super::{AskJob, Simulated};
    use anyhow::{Context, bail};
    use noisefloor::Oracle;
    use noisefloor_cli::say::say;
    use noisefloor_eyes::Eyes;
    use noisefloor_pages::calibrate::{CalibrateServer, CalibrateSetup, CalibrationStage, SimulatedEyes};
    use noisefloor_pages::http::Exposure;
    use std::hash::{BuildHasher, RandomState};
    use std::time::SystemTime;

    pub(super) fn simulate(observer: Simulated) -> anyhow::Result<()> {
        let Simulated { factor, scatter, slips, seed } = observer;
        let oracle = Oracle::bundled();
        let eyes = SimulatedEyes { factor, scatter, slips };
        match eyes
            .calibrate(&oracle, oracle.model().viewing(), seed)
            .context("the model cannot be calibrated")?
        {
            CalibrationStage::Found(found) => {
                let [low, high] = found.interval;
                say!(
                    "found {:.2} times the samples of the model's observers (80 %: {low:.2} to {high:.2}) \
                     after {} answers; the simulated observer needs {factor:.2}",
                    found.factor,
                    found.answers
                )?;
                Ok(())
            }
            CalibrationStage::Refused(refusal) => bail!("{refusal}"),
            CalibrationStage::Asking(_) => bail!("the simulated observer has not answered"),
        }
    }

    pub(super) fn ask(job: AskJob) -> anyhow::Result<()> {
        let AskJob { person: name, out, listen, allow_host } = job;
        Eyes::check_keep(&out, &name).context("nothing was asked, since the result cannot be kept")?;
        let today = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
        let keep = move |person| match Eyes::keep(&out, person) {
            Ok(()) => Ok(out.display().to_string()),
            Err(error) => Err(error.to_string()),
        };
        let setup = CalibrateSetup {
            oracle: Oracle::bundled(),
            name,
            date: today.split('T').next().unwrap_or_default().to_owned(),
            seed: RandomState::new().hash_one(&today),
            keep: Box::new(keep),
        };
        let server = CalibrateServer::bind(setup, listen, &Exposure::named(&allow_host))?;
        say!(
            "open http://{} in a browser, on the display that counts; Ctrl-C ends without a result",
            server.address()
        )?;
        match server.run() {
            Some(Ok(kept)) => say!("kept in {kept}; `noisefloor calibrate --show` says what")?,
            Some(Err(problem)) => bail!("the result could not be kept: {problem}"),
            None => bail!("ended without a result; nothing was kept"),
        }
        Ok(())
    }
}
