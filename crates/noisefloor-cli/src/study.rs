//! `noisefloor study`.

use crate::args::{
    AnalyseArgs, BackupArgs, DataFolderArgs, LinksArgs, ObserverArgs, ServeArgs, SimulateArgs, StudyCommand,
    ThresholdChoice,
};
use anyhow::Context;
use noisefloor_study::analysis::CorpusThreshold;
use noisefloor_study::analysis::files::write;
use noisefloor_study::analysis::raw::write_raw;
use noisefloor_study::analysis::tiles::LEAST_OBSERVERS;
use noisefloor_study::analysis::{AnalysisOptions, StudyReport, analyse};
use noisefloor_study::simulated::{Public, drive};
use noisefloor_study::{Exposure, Study, StudyServer, interrupted, parse_code, store};
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::sync::Arc;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::oneshot;

pub fn run(command: &StudyCommand) -> anyhow::Result<()> {
    match command {
        StudyCommand::Serve(args) => serve(args),
        StudyCommand::Analyse(args) => analysis(args),
        StudyCommand::Simulate(args) => simulate(args),
        StudyCommand::Links(args) => links(args),
        StudyCommand::Data(args) => data(args),
        StudyCommand::Backup(args) => backup(args),
        StudyCommand::Export(args) => {
            let (study, code) = observer(args)?;
            let record = store::read_one(&study.database, &study.design(), &code)?;
            println!("{}", serde_json::to_string_pretty(&record)?);
            Ok(())
        }
        StudyCommand::Erase(args) => {
            let (study, code) = observer(args)?;
            store::erase_one(&study.database, &study.design(), &code)?;
            println!("nothing is kept of {code} any more");
            Ok(())
        }
    }
}

/// A study all of whose pictures can be shown.
fn open(path: &Path) -> anyhow::Result<Arc<Study>> {
    let study = Study::open(path)?;
    study.check_pictures()?;
    Ok(Arc::new(study))
}

fn runtime() -> anyhow::Result<Runtime> {
    Builder::new_multi_thread().enable_all().build().context("no threads for the server")
}

fn serve(args: &ServeArgs) -> anyhow::Result<()> {
    let study = open(&args.study)?;
    runtime()?.block_on(async {
        let address = SocketAddr::new(args.listen, args.port);
        let exposure = Exposure::named(&args.allow_host).trusting(&args.trust_proxy).under(&args.base_path);
        let server = StudyServer::bind(study.clone(), address, &exposure).await?;
        println!("observers begin at http://{}{}; Ctrl-C ends", server.address(), exposure.base_path);
        println!("experimenter's page: http://{}{}", server.address(), server.experimenter_path());
        println!("answers are kept in {}", study.database.display());
        server.run(interrupted()).await?;
        Ok(())
    })
}

fn analysis(args: &AnalyseArgs) -> anyhow::Result<()> {
    let study = Arc::new(Study::open(&args.study)?);
    let (keep_excluded, seed, simulated) = (args.keep_excluded, args.seed, args.simulated);
    let report = analyse(&study, AnalysisOptions { keep_excluded, seed, simulated })?;
    let threshold = match args.threshold {
        ThresholdChoice::Level95 => CorpusThreshold::Level95,
        ThresholdChoice::Mean => CorpusThreshold::Mean,
    };
    write(&args.out, &study, &report, threshold)?;
    print(&report);
    println!("written to {}", args.out.display());
    Ok(())
}

fn print(report: &StudyReport) {
    let who = if report.simulated { "simulated observers" } else { "observers" };
    let finished = report.observers.iter().filter(|o| o.finished).count();
    println!("{} {who}, of whom {finished} answered everything", report.observers.len());
    for row in &report.observers {
        if let Some(why) = &row.excluded {
            println!("  {} is excluded: {why}", row.code);
        }
    }
    if !report.tiles.is_empty() {
        println!("stack                tile      mean  95 % see none   95 % interval");
    }
    for t in &report.tiles {
        let interval = match t.level95_interval {
            Some([low, high]) => format!("{low:.0} to {high:.0}"),
            None => format!("none: {} observers, fewer than {LEAST_OBSERVERS}", t.observers),
        };
        let beyond = if t.beyond { "  beyond the stack" } else { "" };
        let doubt =
            if t.fit_probability.is_some_and(|p| p < 0.01) { "  the spread does not fit" } else { "" };
        println!("{:20} {:4} {:9.0} {:14.0}   {interval}{beyond}{doubt}", t.stack, t.tile, t.mean, t.level95);
    }
    if let Some(r) = report.repeats {
        println!(
            "repeats: {} pairs, apart by a factor of {:.2} (median), {:.0} % within one level",
            r.pairs,
            r.factor,
            100.0 * r.within_one_level
        );
    }
    if let Some(b) = report.between {
        println!(
            "agreement of {} observers over {} tiles: ICC {:.2} for one, {:.2} for their mean",
            b.observers, b.tiles, b.icc_single, b.icc_mean
        );
    }
    for g in &report.groups {
        if let Some(line) = g.least_squares {
            println!(
                "{} against {}: T' = {:.3} T {:+.1}, {} tiles",
                g.to, g.from, line.slope, line.offset, g.tiles
            );
        }
        match (&g.robust, &g.problem) {
            (Some(fit), _) => {
                let r = fit.correlation.map_or("undefined".to_owned(), |r| format!("{r:.2}"));
                println!(
                    "  bearing outliers: render --audience {:.4},{:.2} (r = {r})",
                    fit.line.slope, fit.line.offset
                );
            }
            (None, Some(problem)) => println!("  no line that bears outliers: {problem}"),
            (None, None) => {}
        }
    }
    for c in &report.classes {
        let [low, high] = c.identical.wilson.map(|v| 100.0 * v);
        let class = format!("{:?}", c.class).to_lowercase();
        println!(
            "{class:9} identical in {:.1} % of {} answers (95 % interval {low:.1} to {high:.1} %)",
            100.0 * c.identical.share,
            c.identical.of
        );
    }
}

fn simulate(args: &SimulateArgs) -> anyhow::Result<()> {
    let study = open(&args.study)?;
    let public = Public::made_up(&study);
    let runtime = runtime()?;
    let (stop, stopped) = oneshot::channel::<()>();
    let address = SocketAddr::new(Ipv4Addr::LOCALHOST.into(), 0);
    let server = runtime.block_on(StudyServer::bind(study.clone(), address, &Exposure::default()))?;
    let url = format!("http://{}", server.address());
    let served = runtime.spawn(server.run(async { drop(stopped.await) }));
    let mut events = 0u64;
    for i in 0..u64::from(args.observers) {
        let group = study.groups.get(i as usize % study.groups.len().max(1)).map_or("", String::as_str);
        let mut observer = public.draw(args.seed.wrapping_mul(1000).wrapping_add(i));
        let code = drive(&url, group, &mut observer, |_| events += 1)?;
        println!("simulated observer {}: {code}", i + 1);
    }
    drop(stop);
    runtime.block_on(served).context("the server ended early")??;
    println!("{events} events acknowledged; analyse them with --simulated, which should find:");
    println!("stack                tile    median  95 % see none");
    for (number, stack) in study.stacks.iter().enumerate() {
        for tile in 0..stack.grid().len() {
            let [median, level95] = [0.5, 0.95].map(|share| public.quantile(number, tile, share));
            println!("{:20} {tile:4} {median:9.0} {level95:14.0}", stack.name());
        }
    }
    Ok(())
}

fn links(args: &LinksArgs) -> anyhow::Result<()> {
    let study = Study::open(&args.study)?;
    for token in store::make_links(&study.database, &study.design(), args.count)? {
        println!("{}?link={token}", args.url);
    }
    Ok(())
}

fn data(args: &DataFolderArgs) -> anyhow::Result<()> {
    let study = Arc::new(Study::open(&args.study)?);
    let options = AnalysisOptions { keep_excluded: false, seed: 1, simulated: args.simulated };
    let report = analyse(&study, options)?;
    let mut records = store::read_all(&study.database, &study.design())?;
    records.retain(|record| record.simulated == args.simulated);
    write_raw(&args.out, &study, &records, &report)?;
    println!("{} sessions written to {}", records.len(), args.out.display());
    Ok(())
}

fn backup(args: &BackupArgs) -> anyhow::Result<()> {
    let study = Study::open(&args.study)?;
    store::back_up(&study.database, &study.design(), &args.to)?;
    println!("copied to {}", args.to.display());
    Ok(())
}

fn observer(args: &ObserverArgs) -> anyhow::Result<(Study, String)> {
    let code = parse_code(&args.code)
        .with_context(|| format!("{:?} cannot be a code: a code has twelve letters and digits", args.code))?;
    Ok((Study::open(&args.study)?, code))
}
