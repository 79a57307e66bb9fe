//! `noisefloor render`.

mod denoised;
mod exposure;
mod forecast;
mod frame_report;
mod frames;
mod progress;
mod saving;
mod tev;
#[cfg(feature = "watch")]
mod watch;

use crate::audit::{self, AuditJob};
use crate::job::{CriterionJob, Ready, RenderJob, RenderRun};
use crate::output::{About, Finished, Output, finished_frame};
use anyhow::{Context, anyhow, bail};
use noisefloor::{
    Checkpoint, Driver, DriverError, Event, ProgressiveSource, Repeats, Session, SessionError, SourceInfo,
    StopReason, driver::Progress, watch::Fault,
};
use noisefloor_cli::bars::Log;
use noisefloor_cli::end::Usage;
use noisefloor_cli::files::read_reference;
use noisefloor_cli::folder::{Earlier, Folder};
use noisefloor_cli::note;
use noisefloor_cli::say::one_line;
use noisefloor_cli::signals::{AFTER_THIS_BATCH, INTERRUPTED, cancel_all_on_signal};
use noisefloor_cli::sources::{Opened, Source};
use noisefloor_sidecar::FilterPlan;
use saving::Pace;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tev::Tev;

pub use exposure::{KeyExposure, SequenceExposure, eased, exposure_of};
pub use frames::{EACH, ONE_SEED, SequenceRun, one_frame, render_frames};
pub use progress::reference_bar;
pub use tev::ADDRESS as TEV_ADDRESS;

/// All that must be the same for a render to be resumed, the library checks.
pub const JOB: &str = "noisefloor render";
/// Below this, edge of tiles in pixels, a verdict has few pixels to go by.
const SMALL_TILE: usize = 64;

type Rendering = Driver<Box<dyn Source>>;

pub fn run(run: &RenderRun) -> anyhow::Result<ExitCode> {
    render(run, false)
}

/// Renders; a frame of a sequence that is resumed may be finished already.
fn render(run: &RenderRun, is_frame: bool) -> anyhow::Result<ExitCode> {
    let Some(mut ready) = Prepared::new(run, is_frame)? else { return Ok(ExitCode::SUCCESS) };
    let outcome = ready.sample(run);
    let folder = ready.output.folder().to_string();
    let (ended, places) = (ready.finish(run, outcome)?, run.audit);
    let Some(places) = places.filter(|_| ended == ExitCode::SUCCESS) else { return Ok(ended) };
    audit::run(&AuditJob {
        folder: folder.into(),
        places,
        seed: run.job.source.seed,
        lost: None,
        check: run.check,
        json: false,
        quiet: run.quiet,
        resources: run.resources,
    })
}

/// A render that can begin: whatever can be wrong was found.
struct Prepared {
    began: Instant,
    driver: Rendering,
    output: Output,
    views: Views,
    cancel: Arc<AtomicBool>,
    /// Whether there is a checkpoint to keep.
    keeps: bool,
}

impl Prepared {
    /// `None` if the frame is finished already.
    fn new(run: &RenderRun, is_frame: bool) -> anyhow::Result<Option<Self>> {
        let began = Instant::now();
        let RenderRun { job, resources, quiet, .. } = run;
        let Ready { params, oracle } = job.read()?;
        warn(job, *quiet);
        resources.start_threads()?;
        let opened = job.source.open(*resources)?;
        opened.warn();
        let Opened { mut source, scene, .. } = opened;
        let info = source.info();
        let SourceInfo { name, width, height, .. } = &info;
        let against = run.against.as_deref();
        let reference = against.map(|path| read_reference(path, (*width, *height))).transpose()?;
        let (criterion, denoised) = match (&job.criterion, job.criterion.of(oracle.as_ref())) {
            (_, Some(criterion)) => (criterion, None),
            (CriterionJob::Denoised { lost, passes, device }, None) => {
                let (device, timeout) = (device.clone(), resources.timeout);
                let plan = FilterPlan { device, timeout, ..FilterPlan::default() };
                let rays = job.source.first_hits_spp();
                let (criterion, denoised) = denoised::begin(&mut source, rays, *lost, *passes, plan)?;
                (criterion, Some(denoised))
            }
            (_, None) => bail!("no model was read"),
        };
        let mut driver = Driver::new(source, criterion, params)?;
        driver.set_reference(|source| source.reference());

        let folder = run.out.as_deref().map_or_else(|| PathBuf::from("out").join(&scene), PathBuf::from);
        let earlier = match run.earlier {
            Earlier::Resume if is_frame => match resumed_frame(&driver, &folder, job)? {
                Some(earlier) => earlier,
                None => return Ok(None),
            },
            earlier => earlier,
        };
        let resume = earlier == Earlier::Resume;
        // Only what can be resumed is kept
        let keeps = info.repeats == Repeats::Samples && driver.session().checkpoint(JOB).is_ok();
        if resume && info.repeats != Repeats::Samples {
            bail!(
                "--resume: {name} cannot be resumed, since it may repeat samples after a restart; leave it out"
            );
        }
        if resume {
            driver.session().checkpoint(JOB).context("--resume: leave it out")?;
        }
        let origin = job.source.origin(&scene, name, info.repeats == Repeats::Samples)?;
        let folder = Folder::claim(folder)?;
        let about = About::new(scene, name.clone(), job, oracle.map(|oracle| oracle.model().digest()));
        let mut output = Output::create(folder, earlier, about, !is_frame)?;
        (output.reference, output.origin, output.denoised) = (reference, origin, denoised);
        if resume {
            driver = take_up(driver, &mut output, *quiet)?;
        }
        driver.set_time_limit(run.time.map(|time| sampling_time(time, began, width * height)));
        let cancel = driver.cancel_flag();
        let give_up = output.denoised.as_ref().map(|denoised| denoised.give_up());
        let flags = [Some(Arc::clone(&cancel)), give_up];
        cancel_all_on_signal(flags.into_iter().flatten().collect(), AFTER_THIS_BATCH)?;
        driver.source_mut().watch_reference(reference_bar(*quiet), Arc::clone(&cancel));
        let views = Views::open(run, &output, (*width, *height))?;
        output.about.seconds_setup = Some(began.elapsed().as_secs_f64());
        Ok(Some(Self { began, driver, output, views, cancel, keeps }))
    }

    /// Renders until it is done or cut short.
    fn sample(&mut self, run: &RenderRun) -> Result<(), DriverError> {
        let outcome = sample(&mut self.driver, &mut self.output, &mut self.views, self.keeps, run);
        if let (Ok(()), Some(denoised)) = (&outcome, &self.output.denoised) {
            // Ended between two verdicts, the denoiser answers: the last picture is denoised, too
            denoised.give_up().store(false, Ordering::Relaxed);
        }
        outcome
    }

    /// Writes what there is, also after a failure, and says what became of the render.
    fn finish(mut self, run: &RenderRun, outcome: Result<(), DriverError>) -> anyhow::Result<ExitCode> {
        let checkpoint = snapshot(self.driver.session(), self.keeps);
        let over = (self.driver.clock(), Some(self.driver.source().as_ref()));
        let written = self.output.write(self.driver.session(), checkpoint, over);
        let interrupted = finish(&self.driver, outcome, &self.cancel)?;
        written?;
        let session = self.driver.session();
        if !run.quiet {
            self.output.summarise(session, self.driver.clock(), self.driver.source().as_ref())?;
            // Of a render that was cut short, nobody knows what it would have taken
            let mut reasons = session.stops().map(|stop| stop.reason);
            let is_whole = reasons.all(|reason| matches!(reason, StopReason::Converged | StopReason::MaxSpp));
            if session.is_done() && is_whole && matches!(run.job.criterion, CriterionJob::Oracle { .. }) {
                denoised::say_what_it_would_save(session, self.began.elapsed())?;
            }
        }
        let stopped = session.stops().any(|s| s.reason == StopReason::Cancelled);
        Ok(if stopped || interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
    }
}

/// How a frame of a sequence goes on with what its folder holds; `None` if it is finished.
fn resumed_frame(driver: &Rendering, folder: &Path, job: &RenderJob) -> anyhow::Result<Option<Earlier>> {
    let digest = driver.session().checkpoint(JOB).ok().map(|checkpoint| checkpoint.job_digest());
    match finished_frame(folder, digest.as_deref(), job)? {
        Finished::This => Ok(None),
        Finished::Other => bail!(
            "{}: holds a finished picture of other options, of a scene that has changed since, or of another build; \
             --force renders all frames anew, --out names another folder",
            folder.display()
        ),
        Finished::Lost => Ok(Some(Earlier::Overwrite)),
        Finished::Not => Ok(Some(Earlier::Resume)),
    }
}

/// Says what is unwise about a job.
fn warn(job: &RenderJob, quiet: bool) {
    let tile = job.limits.tile;
    if tile < SMALL_TILE && !quiet && matches!(job.criterion, CriterionJob::Oracle { .. }) {
        note!(
            "warning: tiles of {tile} pixels are small: people judged zones of 100 to 300, \
             and verdicts on tiles below {SMALL_TILE} are less certain"
        );
    }
}

/// Everything that has to be known to continue, if that is possible.
fn snapshot(session: &Session, keeps: bool) -> Option<Checkpoint<'_>> {
    if keeps { session.checkpoint(JOB).ok() } else { None }
}

/// The driver of the render that the output folder holds; as it is if there is none.
fn take_up(driver: Rendering, output: &mut Output, quiet: bool) -> anyhow::Result<Rendering> {
    let Some(checkpoint) = output.checkpoint()? else {
        if !quiet {
            note!("nothing to resume in {}: starting from the beginning", output.folder());
        }
        return Ok(driver);
    };
    let resumed = driver.resume(JOB, checkpoint);
    let driver = resumed.with_context(|| format!("{} (--force renders anew)", output.checkpoint_file()))?;
    if driver.session().is_done() && output.is_finished() {
        let folder = output.folder();
        return Err(Usage(format!(
            "{folder}: holds a render that is finished; ask for more --max-spp or --people, or for less --lost; \
             --force overwrites it, and --out names another folder"
        ))
        .into());
    }
    output.take_up(driver.session().film().total_samples());
    Ok(driver)
}

struct Views {
    tev: Option<Tev>,
    #[cfg(feature = "watch")]
    page: Option<watch::Page>,
}

impl Views {
    fn open(run: &RenderRun, output: &Output, size: (usize, usize)) -> anyhow::Result<Self> {
        Ok(Self {
            tev: run
                .tev
                .as_deref()
                .map(|address| Tev::open(address, &output.about.scene, size))
                .transpose()?,
            #[cfg(feature = "watch")]
            page: run.watch.as_ref().map(|page| watch::Page::serve(page, output, run.quiet)).transpose()?,
        })
    }

    fn show(&mut self, session: &Session, progress: &Progress) {
        tev::show(&mut self.tev, session, false);
        #[cfg(feature = "watch")]
        if let Some(page) = &mut self.page {
            page.show(session, progress);
        }
        #[cfg(not(feature = "watch"))]
        let _ = progress;
    }

    fn close(&mut self, session: &Session) {
        tev::show(&mut self.tev, session, true);
        #[cfg(feature = "watch")]
        if let Some(page) = &mut self.page {
            page.close(session);
        }
    }
}

/// What is left for samples of the time for everything, once all is set up: the files are still to be
/// written. At least half of it, so that there is something to write.
fn sampling_time(time: Duration, began: Instant, pixels: usize) -> Duration {
    let left = time.saturating_sub(began.elapsed());
    left.saturating_sub(saving::last_save(pixels)).max(left / 2)
}

/// Renders. A failure to save along the way is reported at once, and rendering goes on: the disk may have
/// room again.
fn sample(
    driver: &mut Rendering,
    output: &mut Output,
    views: &mut Views,
    keeps: bool,
    run: &RenderRun,
) -> Result<(), DriverError> {
    let bar = progress::bar(run.quiet);
    let mut log = Log::new(run.quiet);
    let grid = driver.session().film().grid();
    let [mut checkpoints, mut pictures] = Pace::both(run.autosave, grid.width() * grid.height());
    let mut told = 0;
    let mut warn = |session: &Session<_>| {
        let new = session.warnings().iter().skip(told);
        bar.suspend(|| new.for_each(|warning| note!("warning: {warning}")));
        told = session.warnings().len();
    };
    let outcome = driver.run(|session, event| {
        warn(session);
        let Event::BatchDone(progress) = event else { return };
        output.record(session, progress);
        progress::show(&bar, &mut log, session, progress);
        bar.suspend(|| views.show(session, progress));
        let mut save = |pace: &mut Pace, write: &mut dyn FnMut(&mut Output) -> anyhow::Result<()>| {
            if pace.is_due() {
                let began = Instant::now();
                if let Err(error) = write(output) {
                    bar.suspend(|| note!("warning: not saved: {}", one_line(&error)));
                }
                pace.pause_after(began.elapsed());
            }
        };
        save(&mut pictures, &mut |output| output.write_pictures(session));
        save(&mut checkpoints, &mut |output| output.write_progress(session, snapshot(session, keeps)));
    });
    warn(driver.session());
    bar.finish_and_clear();
    views.close(driver.session());
    outcome
}

/// Says what the user should know after the run, and whether Ctrl-C ended the source in the middle of a
/// batch: in a terminal it ends a command that renders, too, which is no failure.
fn finish(driver: &Rendering, outcome: Result<(), DriverError>, cancel: &AtomicBool) -> anyhow::Result<bool> {
    driver.source().notes().iter().for_each(|text| note!("warning: {text}"));
    match outcome {
        Err(error) if cancel.load(Ordering::Relaxed) => {
            let what = if matches!(error, DriverError::Criterion(_)) { "verdict" } else { "batch" };
            note!("warning: the {what} under way is lost: {}", one_line(&error.into()));
            Ok(true)
        }
        Err(DriverError::Session(SessionError::Fault(fault))) => {
            Err(anyhow!("{}: {}", driver.source().info().name, in_a_user_s_words(&fault)))
        }
        outcome => Ok(outcome.map(|()| false)?),
    }
}

/// Whoever uses the command does not push samples.
fn in_a_user_s_words(fault: &Fault) -> String {
    match fault {
        Fault::Repeated { tiles, of } => format!(
            "{tiles} of {of} tiles got the same samples twice: the renderer repeats its random numbers, \
             or two of the pictures are one"
        ),
        Fault::Running { .. } => "its batches contain the samples of the ones before: \
        name running means by their samples per pixel (00100.exr), \
        and batches by their first and last sample (batch_00060_00100.exr)"
            .to_owned(),
        Fault::Shared { correlation } => format!(
            "its successive batches share samples (correlation {correlation:.2}): \
             its seeds repeat or overlap, or its scene changes from one to the next"
        ),
        Fault::Quantised { encoding } => format!(
            "all values are {encoding} of 8 bits: let it write linear radiance in floating point, \
             as EXR or PFM"
        ),
        other => other.to_string(),
    }
}
