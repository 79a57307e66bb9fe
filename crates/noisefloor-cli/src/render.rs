//! `noisefloor render`.

use crate::INTERRUPTED;
use crate::args::{CriterionChoice, FilterChoice, RenderArgs, SamplerChoice};
use crate::output::{ModelFacts, Output, RelMse};
use anyhow::{Context, bail};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use noisefloor::{Driver, Event, FixedSamples, Progress, Session, StopReason, StoppingCriterion};
use noisefloor_ptwne::{Estimator, Filter, Options, Ptwne, Sampling, scenes};
use noisefloor_scenefile::Loaded;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Where neither the command nor the scene says: a Cornell box takes half a minute.
const DEFAULT_SIZE: (usize, usize) = (384, 384);
const DEFAULT_DEPTH: u32 = 65;

pub fn run(args: &RenderArgs) -> anyhow::Result<ExitCode> {
    // Whatever can be wrong is found before anything is rendered.
    let params = args.params()?;
    let Loaded { scene, size, max_depth, warnings } = load(&args.scene)?;
    if !args.quiet {
        warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    }
    let (width, height) = args.size.or(size).unwrap_or(DEFAULT_SIZE);
    let rel_mse = args.against.as_deref().map(|path| RelMse::load(path, (width, height))).transpose()?;
    if let Some(threads) = args.threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads.get()).build_global().context("--threads")?;
    }
    let name = scene.name().to_owned();
    let options = Options {
        seed: args.seed,
        max_depth: args.max_depth.or(max_depth).unwrap_or(DEFAULT_DEPTH),
        estimator: if args.no_mis { Estimator::NextEvents } else { Estimator::Mis },
        sampling: match args.sampler {
            SamplerChoice::Independent => Sampling::Independent,
            SamplerChoice::Sobol => Sampling::Sobol,
        },
        filter: match args.filter {
            FilterChoice::Box => Filter::Box,
            FilterChoice::Tent => Filter::Tent,
            FilterChoice::Gaussian => Filter::Gaussian,
        },
        clamp: args.clamp,
        ..Options::default()
    };
    let source = Ptwne::new(scene, width, height, options)?;
    match args.criterion {
        CriterionChoice::Oracle => {
            let oracle = args.oracle.load()?;
            let facts = ModelFacts { digest: oracle.model().digest(), just_visible: oracle.just_visible() };
            drive(Driver::new(source, oracle, params)?, args, name, Some(facts), rel_mse)
        }
        CriterionChoice::Fixed(samples) => {
            drive(Driver::new(source, FixedSamples(samples), params)?, args, name, None, rel_mse)
        }
    }
}

/// A built-in scene of that name, or the scene in that file.
fn load(scene: &str) -> anyhow::Result<Loaded> {
    if let Some(scene) = scenes::by_name(scene) {
        return Ok(Loaded { scene, size: None, max_depth: None, warnings: vec![] });
    }
    let path = Path::new(scene);
    if path.extension().is_none() && !path.exists() {
        bail!(
            "there is no built-in scene {scene:?}, nor a file of that name; `noisefloor scenes` lists the built-in ones"
        );
    }
    Ok(noisefloor_scenefile::load(path)?)
}

fn drive<C: StoppingCriterion>(
    mut driver: Driver<Ptwne, C>,
    args: &RenderArgs,
    scene: String,
    model: Option<ModelFacts>,
    rel_mse: Option<RelMse>,
) -> anyhow::Result<ExitCode> {
    let mut output = Output::create(args, scene, model, rel_mse)?;
    driver.set_time_limit(args.time);
    cancel_on_signal(driver.cancel_flag())?;
    let bar = progress_bar(args.quiet);
    let autosave = args.autosave;
    let mut saved = Instant::now();

    // Render. A failure to save along the way is told at once, and rendering goes on: the disk may have room again.
    let outcome = driver.run(|session, event| {
        if let Event::BatchDone(progress) = event {
            output.record(session, progress);
            show(&bar, session, progress);
            if !autosave.is_zero() && saved.elapsed() >= autosave {
                if let Err(error) = output.write(session, None) {
                    bar.suspend(|| eprintln!("warning: not saved: {}", crate::one_line(&error)));
                }
                saved = Instant::now();
            }
        }
    });
    bar.finish_and_clear();

    // Write what there is, also after a failure.
    let written = output.write(driver.session(), Some((driver.clock(), driver.source())));
    outcome?;
    written?;
    if !args.quiet {
        output.summarise(driver.session(), driver.clock(), driver.source());
    }
    let cancelled = driver.session().stops().any(|s| s.reason == StopReason::Cancelled);
    Ok(if cancelled { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// The first signal asks the driver to end; a second one ends the process at once.
fn cancel_on_signal(cancel: Arc<AtomicBool>) -> anyhow::Result<()> {
    ctrlc::set_handler(move || {
        if cancel.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(INTERRUPTED));
        }
        eprintln!("\nstopping after this batch; what is there will be written (again to quit at once)");
    })
    .context("the handler for Ctrl-C could not be set")
}

fn progress_bar(quiet: bool) -> ProgressBar {
    let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let style = ProgressStyle::with_template("{bar:20} {pos}/{len} tiles done, {elapsed}, {msg}");
    let bar = ProgressBar::with_draw_target(Some(0), target);
    style.map(|style| bar.clone().with_style(style)).unwrap_or(bar)
}

fn show<C: StoppingCriterion>(bar: &ProgressBar, session: &Session<C>, progress: &Progress) {
    let pixels = (session.film().grid().width() * session.film().grid().height()) as f64;
    let eta = match progress.eta_seconds {
        Some(seconds) => {
            let left = Duration::from_secs(seconds.clamp(0.0, 1e9) as u64);
            format!("about {} to go", HumanDuration(left))
        }
        None => "no estimate yet".into(),
    };
    bar.set_length(progress.tiles as u64);
    bar.set_position((progress.tiles - progress.now.active_tiles) as u64);
    bar.set_message(format!("{:.0} spp, {eta}", progress.now.samples as f64 / pixels));
}
