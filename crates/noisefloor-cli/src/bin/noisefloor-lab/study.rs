//! `noisefloor-lab study`.

mod report;
mod stack;

use crate::args::study::{
    AnalyseArgs, BackupArgs, DataFolderArgs, LinksArgs, ObserverArgs, ServeArgs, SimulateArgs, StudyCommand,
    ThresholdChoice,
};
use anyhow::Context;
use noisefloor_cli::say::{say, say_json};
use noisefloor_pages::http::{Exposure, interrupted};
use noisefloor_study::analysis::files::write;
use noisefloor_study::analysis::raw::write_raw;
use noisefloor_study::analysis::{AnalysisOptions, CorpusThreshold, analyse};
use noisefloor_study::simulated::{Public, drive};
use noisefloor_study::{Study, StudyServer, parse_code, store};
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::sync::Arc;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::oneshot;

pub fn run(command: StudyCommand) -> anyhow::Result<()> {
    match command {
        StudyCommand::Stack(args) => stack::render(args),
        StudyCommand::Serve(args) => serve(&args),
        StudyCommand::Analyse(args) => analysis(&args),
        StudyCommand::Simulate(args) => simulate(&args),
        StudyCommand::Links(args) => links(&args),
        StudyCommand::Data(args) => data(&args),
        StudyCommand::Backup(args) => backup(&args),
        StudyCommand::Export(args) => {
            let (study, code) = observer(&args)?;
            say_json(&store::read_one(&study.database, &study.design(), &code)?)
        }
        StudyCommand::Erase(args) => {
            let (study, code) = observer(&args)?;
            store::erase_one(&study.database, &study.design(), &code)?;
            Ok(say!("everything about {code} has been erased")?)
        }
    }
}

/// A study all of whose pictures can be shown.
fn complete(path: &Path) -> anyhow::Result<Arc<Study>> {
    let study = Study::open(path)?;
    study.check_pictures()?;
    Ok(Arc::new(study))
}

/// A study, and the code of one of its observers in its canonical form.
fn observer(args: &ObserverArgs) -> anyhow::Result<(Study, String)> {
    let code = parse_code(&args.code)
        .with_context(|| format!("{:?} cannot be a code: a code has twelve letters and digits", args.code))?;
    Ok((Study::open(&args.study)?, code))
}

fn runtime() -> anyhow::Result<Runtime> {
    Builder::new_multi_thread().enable_all().build().context("no threads for the server")
}

fn serve(args: &ServeArgs) -> anyhow::Result<()> {
    let study = complete(&args.study)?;
    let address = SocketAddr::new(args.listen, args.port);
    let exposure = Exposure::named(&args.allow_host).trusting(&args.trust_proxy).under(&args.base_path);
    runtime()?.block_on(async {
        let server = StudyServer::bind(study.clone(), address, &exposure).await?;
        let server = if args.admit_simulated { server.admitting_simulated() } else { server };
        let address = server.address();
        say!("observers begin at http://{address}{}; Ctrl-C ends the server", exposure.base_path)?;
        say!("experimenter's page: http://{address}{}", server.experimenter_path())?;
        say!("answers are stored in {}", study.database.display())?;
        server.run(interrupted()).await?;
        Ok(())
    })
}

fn analysis(args: &AnalyseArgs) -> anyhow::Result<()> {
    let study = Arc::new(Study::open(&args.study)?);
    let AnalyseArgs { keep_excluded, seed, simulated, .. } = *args;
    let report = analyse(&study, AnalysisOptions { keep_excluded, seed, simulated })?;
    let threshold = match args.threshold {
        ThresholdChoice::Level95 => CorpusThreshold::Level95,
        ThresholdChoice::Mean => CorpusThreshold::Mean,
    };
    write(&args.out, &study, &report, threshold)?;
    report::say_all(&report)?;
    say!("written to {}", args.out.display())?;
    Ok(())
}

fn simulate(args: &SimulateArgs) -> anyhow::Result<()> {
    let study = &complete(&args.study)?;
    let public = Public::made_up(study).spread_by(args.spread);
    let runtime = runtime()?;
    let (stop, stopped) = oneshot::channel::<()>();
    let address = SocketAddr::new(Ipv4Addr::LOCALHOST.into(), 0);
    let server = runtime.block_on(StudyServer::bind(study.clone(), address, &Exposure::default()))?;
    let server = server.admitting_simulated();
    let url = format!("http://{}", server.address());
    let served = runtime.spawn(server.run(async { drop(stopped.await) }));
    let mut events = 0u64;
    for i in 0..u64::from(args.observers) {
        let group = study.groups.get(i as usize % study.groups.len().max(1)).map_or("", String::as_str);
        let mut observer = public.draw(args.seed.wrapping_mul(1000).wrapping_add(i));
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

fn links(args: &LinksArgs) -> anyhow::Result<()> {
    let study = Study::open(&args.study)?;
    for token in store::make_links(&study.database, &study.design(), args.count)? {
        say!("{}?link={token}", args.url)?;
    }
    Ok(())
}

fn data(DataFolderArgs { study, out, simulated }: &DataFolderArgs) -> anyhow::Result<()> {
    let study = &Arc::new(Study::open(study)?);
    let options = AnalysisOptions { keep_excluded: false, seed: 1, simulated: *simulated };
    let report = analyse(study, options)?;
    let mut records = store::read_all(&study.database, &study.design())?;
    records.retain(|record| record.simulated == *simulated);
    write_raw(out, study, &records, &report)?;
    say!("{} sessions written to {}", records.len(), out.display())?;
    Ok(())
}

fn backup(BackupArgs { study, to }: &BackupArgs) -> anyhow::Result<()> {
    let study = Study::open(study)?;
    store::back_up(&study.database, &study.design(), to)?;
    say!("copied to {}", to.display())?;
    Ok(())
}
