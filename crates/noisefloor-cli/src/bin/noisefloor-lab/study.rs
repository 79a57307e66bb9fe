//! `noisefloor-lab study`.

mod report;
mod stack;

use anyhow::Context;
use noisefloor_cli::say::{say, say_json};
use noisefloor_pages::http::{Exposure, interrupted};
use noisefloor_study::analysis::files::write;
use noisefloor_study::analysis::raw::write_raw;
use noisefloor_study::analysis::{AnalysisOptions, CorpusThreshold, analyse};
use noisefloor_study::simulated::{Public, drive};
use noisefloor_study::{Study, StudyServer, store};
pub use stack::{StackDenoiser, StackJob};
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::oneshot;

/// What to do with a study: checked.
pub enum StudyJob {
    Stack(StackJob),
    Serve(ServeJob),
    Analyse(AnalyseJob),
    Simulate(SimulateJob),
    Links(LinksJob),
    Data(DataFolderJob),
    Backup(BackupJob),
    Export(ObserverJob),
    Erase(ObserverJob),
}

pub struct ServeJob {
    /// All its pictures can be shown.
    pub study: Arc<Study>,
    pub address: SocketAddr,
    /// Names, proxies and the path that the server answers to.
    pub exposure: Exposure,
    pub admit_simulated: bool,
}

pub struct AnalyseJob {
    pub study: Arc<Study>,
    pub out: PathBuf,
    pub options: AnalysisOptions,
    pub threshold: CorpusThreshold,
}

pub struct SimulateJob {
    /// All its pictures can be shown.
    pub study: Arc<Study>,
    pub observers: u16,
    /// Standard deviation of ln(threshold) between people in one place.
    pub spread: f64,
    pub seed: u64,
}

pub struct LinksJob {
    pub study: Study,
    pub count: u32,
    pub url: String,
}

pub struct DataFolderJob {
    pub study: Arc<Study>,
    pub out: PathBuf,
    pub simulated: bool,
}

pub struct BackupJob {
    pub study: Study,
    pub to: PathBuf,
}

pub struct ObserverJob {
    pub study: Study,
    /// In its canonical form.
    pub code: String,
}

pub fn run(job: StudyJob) -> anyhow::Result<()> {
    match job {
        StudyJob::Stack(job) => stack::render(&job),
        StudyJob::Serve(job) => serve(job),
        StudyJob::Analyse(job) => analysis(&job),
        StudyJob::Simulate(job) => simulate(&job),
        StudyJob::Links(job) => links(&job),
        StudyJob::Data(job) => data(&job),
        StudyJob::Backup(job) => backup(&job),
        StudyJob::Export(ObserverJob { study, code }) => {
            let record = store::read_one(&study.database, &study.design(), &code)?;
            say_json(&record)
        }
        StudyJob::Erase(ObserverJob { study, code }) => {
            store::erase_one(&study.database, &study.design(), &code)?;
            say!("everything about {code} has been erased")?;
            Ok(())
        }
    }
}

fn runtime() -> anyhow::Result<Runtime> {
    Builder::new_multi_thread().enable_all().build().context("no threads for the server")
}

fn serve(job: ServeJob) -> anyhow::Result<()> {
    let ServeJob { study, address, exposure, admit_simulated } = job;
    runtime()?.block_on(async {
        let server = StudyServer::bind(study.clone(), address, &exposure).await?;
        let server = if admit_simulated { server.admitting_simulated() } else { server };
        let address = server.address();
        say!("observers begin at http://{address}{}; Ctrl-C ends the server", exposure.base_path)?;
        say!("experimenter's page: http://{address}{}", server.experimenter_path())?;
        say!("answers are stored in {}", study.database.display())?;
        server.run(interrupted()).await?;
        Ok(())
    })
}

fn analysis(job: &AnalyseJob) -> anyhow::Result<()> {
    let report = analyse(&job.study, job.options)?;
    write(&job.out, &job.study, &report, job.threshold)?;
    report::say_all(&report)?;
    say!("written to {}", job.out.display())?;
    Ok(())
}

fn simulate(job: &SimulateJob) -> anyhow::Result<()> {
    let study = &job.study;
    let public = Public::made_up(study).spread_by(job.spread);
    let runtime = runtime()?;
    let (stop, stopped) = oneshot::channel::<()>();
    let address = SocketAddr::new(Ipv4Addr::LOCALHOST.into(), 0);
    let server = runtime.block_on(StudyServer::bind(study.clone(), address, &Exposure::default()))?;
    let server = server.admitting_simulated();
    let url = format!("http://{}", server.address());
    let served = runtime.spawn(server.run(async { drop(stopped.await) }));
    let mut events = 0u64;
    for i in 0..u64::from(job.observers) {
        let group = study.groups.get(i as usize % study.groups.len().max(1)).map_or("", String::as_str);
        let mut observer = public.draw(job.seed.wrapping_mul(1000).wrapping_add(i));
        let code = drive(&url, group, &mut observer, |_| events += 1)?;
        say!("simulated observer {}: {code}", i + 1)?;
    }
    drop(stop);
    runtime.block_on(served).context("the server ended early")??;
    say!("{events} events acknowledged; analyse them with --simulated, which should find:")?;
    say!("{}", report::COLUMNS)?;
    for (number, stack) in study.stacks.iter().enumerate() {
        for tile in 0..stack.grid().len() {
            report::say_levels(stack.name(), tile, public.levels(number, tile), "")?;
        }
    }
    say!("{}", report::WHAT_TRAIN_GETS)?;
    say!("spread of people in one place: {:.2} in ln(samples)", public.deviation())?;
    Ok(())
}

fn links(job: &LinksJob) -> anyhow::Result<()> {
    for token in store::make_links(&job.study.database, &job.study.design(), job.count)? {
        say!("{}?link={token}", job.url)?;
    }
    Ok(())
}

fn data(job: &DataFolderJob) -> anyhow::Result<()> {
    let DataFolderJob { study, out, simulated } = job;
    let options = AnalysisOptions { keep_excluded: false, seed: 1, simulated: *simulated };
    let report = analyse(study, options)?;
    let mut records = store::read_all(&study.database, &study.design())?;
    records.retain(|record| record.simulated == *simulated);
    write_raw(out, study, &records, &report)?;
    say!("{} sessions written to {}", records.len(), out.display())?;
    Ok(())
}

fn backup(job: &BackupJob) -> anyhow::Result<()> {
    store::back_up(&job.study.database, &job.study.design(), &job.to)?;
    say!("copied to {}", job.to.display())?;
    Ok(())
}
