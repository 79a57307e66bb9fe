//! `noisefloor render`.

use crate::INTERRUPTED;
use crate::args::{CriterionChoice, RenderArgs, RendererArgs};
use crate::bars::bar;
use crate::output::{ModelFacts, Output, read_reference};
use crate::sources::{self, Opened, Source};
use anyhow::{Context, bail};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use noisefloor::{
    Checkpoint, CheckpointError, Driver, Event, FixedSpp, Progress, ProgressiveSource, Repeats, Resumable,
    Rgb, Session, SourceInfo, StopReason, StoppingCriterion,
};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

pub fn run(args: &RenderArgs) -> anyhow::Result<ExitCode> {
    // Whatever can be wrong is found before anything is rendered.
    let params = args.params()?;
    args.renderer.set_threads()?;
    let Opened { source, scene, warnings } = sources::open(args.scene.as_deref(), &args.renderer)?;
    if !args.quiet {
        warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    }
    let SourceInfo { width, height, .. } = source.info();
    let reference = args.against.as_deref().map(|path| read_reference(path, (width, height))).transpose()?;
    match &args.criterion {
        CriterionChoice::Oracle => {
            let oracle = args.oracle.load()?;
            let facts = ModelFacts { digest: oracle.model().digest(), just_visible: oracle.just_visible() };
            drive(Driver::new(source, oracle, params)?, args, scene, Some(facts), reference, snapshots())
        }
        CriterionChoice::Fixed(samples) => {
            drive(Driver::new(source, FixedSpp(*samples), params)?, args, scene, None, reference, snapshots())
        }
        CriterionChoice::Rival(spec) if args.resume => {
            bail!(
                "--resume does not go with --criterion {spec}, which keeps a state of its own; leave it out"
            )
        }
        CriterionChoice::Rival(spec) => {
            let criterion = noisefloor_rivals::parse(spec)?;
            drive(Driver::new(source, criterion, params)?, args, scene, None, reference, None)
        }
    }
}

type Rendering<C> = Driver<Box<dyn Source>, C>;

/// How a render is saved and resumed.
struct Snapshots<C> {
    save: for<'a> fn(&'a Session<C>, &'a str) -> Checkpoint<'a>,
    resume: fn(Rendering<C>, &str, Checkpoint<'_>) -> Result<Rendering<C>, CheckpointError>,
}

fn snapshots<C: Resumable>() -> Option<Snapshots<C>> {
    Some(Snapshots { save: Session::checkpoint, resume: Driver::resume })
}

fn checkpoint<'a, C>(
    snapshots: &Option<Snapshots<C>>,
    session: &'a Session<C>,
    job: &'a str,
) -> Option<Checkpoint<'a>> {
    snapshots.as_ref().map(|s| (s.save)(session, job))
}

fn drive<C: StoppingCriterion>(
    mut driver: Rendering<C>,
    args: &RenderArgs,
    scene: String,
    model: Option<ModelFacts>,
    reference: Option<Vec<Rgb>>,
    snapshots: Option<Snapshots<C>>,
) -> anyhow::Result<ExitCode> {
    let info = driver.source().info();
    let snapshots = snapshots.filter(|_| info.repeats == Repeats::Samples);
    if args.resume && snapshots.is_none() {
        bail!(
            "--resume: {} cannot be resumed, since it may repeat samples after a restart; leave it out",
            info.name
        )
    }
    let job = job(args, &info.name, model.as_ref());
    let mut output = Output::create(args, scene, info.name, model, reference, snapshots.is_some())?;
    if let Some(Snapshots { resume, .. }) = snapshots.as_ref().filter(|_| args.resume) {
        match output.checkpoint()? {
            Some(checkpoint) => {
                driver = resume(driver, &job, checkpoint).with_context(|| output.checkpoint_file())?;
                output.take_up(driver.session().film().total_samples());
            }
            None if args.quiet => {}
            None => eprintln!("there is nothing to go on with in {}: beginning", output.folder()),
        }
    }
    driver.set_time_limit(args.time);
    let cancel = driver.cancel_flag();
    cancel_on_signal(Arc::clone(&cancel), AFTER_THIS_BATCH)?;
    driver.source_mut().watch_reference(reference_bar(args.quiet), Arc::clone(&cancel));
    let bar = progress_bar(args.quiet);
    let autosave = args.autosave;
    let mut saved = Instant::now();

    // Render. A failure to save along the way is told at once, and rendering goes on: the disk may have room again.
    let outcome = driver.run(|session, event| {
        if let Event::BatchDone(progress) = event {
            output.record(session, progress);
            show(&bar, session, progress);
            if !autosave.is_zero() && saved.elapsed() >= autosave {
                if let Err(error) = output.write(session, checkpoint(&snapshots, session, &job), None) {
                    bar.suspend(|| eprintln!("warning: not saved: {}", crate::one_line(&error)));
                }
                saved = Instant::now();
            }
        }
    });
    bar.finish_and_clear();

    // Write what there is, also after a failure.
    let source = driver.source();
    let written = output.write(
        driver.session(),
        checkpoint(&snapshots, driver.session(), &job),
        Some((driver.clock(), source.as_ref())),
    );
    source.notes().iter().for_each(|note| eprintln!("warning: {note}"));
    let mut cancelled = driver.session().stops().any(|s| s.reason == StopReason::Cancelled);
    match outcome {
        // Ctrl-C in a terminal ends a command that renders, too.
        Err(error) if cancel.load(Ordering::Relaxed) => {
            eprintln!("warning: what was under way is lost: {}", crate::one_line(&error.into()));
            cancelled = true;
        }
        outcome => outcome?,
    }
    written?;
    if !args.quiet {
        output.summarise(driver.session(), driver.clock(), source.as_ref());
    }
    Ok(if cancelled { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// What must be the same for a render to be gone on with, beside parameters, criterion and size.
fn job(args: &RenderArgs, source: &str, model: Option<&ModelFacts>) -> String {
    let RendererArgs { seed, max_depth, no_mis, sampler, filter, clamp, .. } = &args.renderer;
    let (scene, threshold) = (args.scene.as_deref().unwrap_or("the default scene"), args.oracle.threshold);
    let model = model.map_or("no model", |m| &m.digest);
    format!(
        "{source}, {scene}, seed {seed}, depth {max_depth:?}, no-mis {no_mis}, sampler {sampler:?}, filter {filter:?}, clamp {clamp:?}, \
         {model}, threshold {threshold}"
    )
}

/// What Ctrl-C does to samples.
pub const AFTER_THIS_BATCH: &str = "stopping after this batch; what is there will be written";

/// The first signal asks the work to end, which `says` how; a second one ends the process at once.
pub fn cancel_on_signal(cancel: Arc<AtomicBool>, says: &'static str) -> anyhow::Result<()> {
    ctrlc::set_handler(move || {
        if cancel.swap(true, Ordering::Relaxed) {
            noisefloor_sidecar::end_all();
            std::process::exit(i32::from(INTERRUPTED));
        }
        eprintln!("\n{says} (again to quit at once)");
    })
    .context("the handler for Ctrl-C could not be set")
}

pub fn reference_bar(quiet: bool) -> ProgressBar {
    if quiet { ProgressBar::hidden() } else { bar(0, "blocks of the reference") }
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
