//! `noisefloor render`.

mod frames;
mod progress;
mod saving;
mod snapshots;
mod tev;
#[cfg(feature = "study")]
mod watch;

use crate::bars::Log;
use crate::files::read_reference;
use crate::folder::{Earlier, Folder};
use crate::output::{Denoised, Output};
use crate::say::{note, one_line};
use crate::signals::{AFTER_THIS_BATCH, INTERRUPTED, cancel_all_on_signal};
use crate::sources::{Opened, SourceJob, SourceKind};
use anyhow::bail;
use noisefloor::{
    Driver, DriverError, Event, FixedSpp, Oracle, Params, ProgressiveSource, Repeats, Rgb, Session,
    SourceInfo, StopReason, StoppingCriterion, driver::Progress, stills::SampleOrigin,
};
#[cfg(feature = "adapters")]
use noisefloor::{SourceError, source::FirstHits};
#[cfg(feature = "adapters")]
use noisefloor_denoise::{AuxiliaryPictures, DenoisedQuality, Denoiser, Oidn};
#[cfg(feature = "adapters")]
use noisefloor_sidecar::FilterPlan;
#[cfg(feature = "study")]
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
#[cfg(feature = "adapters")]
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

pub use frames::{FramePattern, SequenceJob, render_frames};
pub use progress::reference_bar;
pub use saving::Autosave;
use saving::Pace;
#[cfg(feature = "farm")]
pub use snapshots::JOB;
use snapshots::{Rendering, Snapshots};
pub use tev::ADDRESS as TEV_ADDRESS;
use tev::Tev;

/// Camera rays a pixel for albedo and normals, of each half: edges are then smoother than in the radiance of most
/// pictures, for the time of a few samples of it.
#[cfg(feature = "adapters")]
pub const FIRST_HITS_SPP: u64 = 32;

/// What is rendered, and until when: checked.
pub struct RenderJob {
    pub source: SourceJob,
    pub judge: Judge,
    pub params: Params,
    pub out: Option<PathBuf>,
    /// For everything, from the start of the command to the last file.
    pub time: Option<Duration>,
    pub against: Option<PathBuf>,
    pub autosave: Autosave,
    pub earlier: Earlier,
    pub quiet: bool,
    /// Address of a viewer.
    pub tev: Option<String>,
    /// Where to serve a page.
    #[cfg(feature = "study")]
    pub watch: Option<SocketAddr>,
}

/// Who stops the tiles.
pub enum Judge {
    Oracle(Box<Oracle>),
    Fixed(u64),
    /// By the picture that Open Image Denoise makes, of which a tile may lose so many JODs.
    #[cfg(feature = "adapters")]
    Denoised(f64),
    /// A specification that is known to be right.
    Rival(String),
}

pub fn run(job: RenderJob) -> anyhow::Result<ExitCode> {
    // Whatever can be wrong is found before anything is rendered.
    let began = Instant::now();
    let RenderJob { source, judge, params, .. } = &job;
    source.start_threads()?;
    let opened = source.open()?;
    opened.warn();
    let Opened { mut source, scene, .. } = opened;
    let SourceInfo { name, width, height, .. } = source.info();
    if params.blocks > 0 && source.sample_blocks(&[])?.is_none() {
        bail!("{name} cannot sample blocks of a tile by their need: leave out --blocks");
    }
    let against = job.against.as_deref();
    let reference = against.map(|path| read_reference(path, (width, height))).transpose()?;
    let rest = Rest { job: &job, began, scene, reference, model: None, denoised: None };
    match judge {
        Judge::Oracle(oracle) => {
            let rest = Rest { model: Some(oracle.model().digest()), ..rest };
            let driver = Driver::new(source, oracle.as_ref().clone(), *params)?;
            rest.drive(driver, Some(Snapshots::new()))
        }
        Judge::Fixed(spp) => {
            let driver = Driver::new(source, FixedSpp(*spp), *params)?;
            rest.drive(driver, Some(Snapshots::new()))
        }
        #[cfg(feature = "adapters")]
        Judge::Denoised(lost) => {
            let plan = FilterPlan { timeout: job.source.timeout, ..FilterPlan::default() };
            let (mut denoiser, give_up) = (Oidn::start(plan)?, Arc::<AtomicBool>::default());
            denoiser.give_up_when(Arc::clone(&give_up));
            let denoiser = Arc::new(Mutex::new(denoiser));
            let mut criterion = DenoisedQuality::new(Arc::clone(&denoiser), *lost);
            let guides = guides(&mut source, denoiser.wants())?;
            if let Some(guides) = &guides {
                criterion = criterion.guided_by(Arc::clone(guides));
            }
            let denoised = Denoised::new(denoiser, guides.as_deref(), criterion.record(), give_up);
            let rest = Rest { denoised: Some(denoised), ..rest };
            rest.drive(Driver::new(source, criterion, *params)?, Some(Snapshots::new()))
        }
        // A rival's state is not kept
        Judge::Rival(spec) => {
            rest.drive(Driver::new(source, noisefloor_rivals::parse(spec)?, *params)?, None)
        }
    }
}

/// Albedo and normals for each half, if the denoiser makes use of them and the source has them.
#[cfg(feature = "adapters")]
fn guides(
    source: &mut impl ProgressiveSource,
    wants: AuxiliaryPictures,
) -> Result<Option<Arc<[FirstHits; 2]>>, SourceError> {
    if !wants.any() {
        return Ok(None);
    }
    let Some(a) = source.first_hits(0, FIRST_HITS_SPP)? else { return Ok(None) };
    Ok(source.first_hits(1, FIRST_HITS_SPP)?.map(|b| Arc::new([a, b])))
}

/// Where samples come from, for the picture's file; none for pictures that are played back. Paths and command
/// lines go in as a digest: pictures travel further than they should.
pub fn origin(job: &SourceJob, scene: &str, info: &SourceInfo) -> Option<SampleOrigin> {
    let SourceJob { kind, scene: typed, seed, max_depth, scene_files, .. } = job;
    if matches!(kind, SourceKind::Exr) {
        return None;
    }
    let kind = match kind {
        // Its functions have other addresses in every run
        #[cfg(feature = "adapters")]
        SourceKind::Adapter(_) => kind.name().to_owned(),
        kind => format!("{kind:?}"),
    };
    let all = format!("{typed:?}, {max_depth:?}, {kind}, {scene_files:?}");
    let digest = blake3::hash(all.as_bytes()).to_hex();
    let (source, options) = (format!("{scene} by {}", info.name), digest[..16].to_owned());
    Some(SampleOrigin { source, options, seed: *seed, repeats: info.repeats == Repeats::Samples })
}

/// What a render is made of beside its driver.
struct Rest<'a> {
    job: &'a RenderJob,
    began: Instant,
    scene: String,
    reference: Option<Vec<Rgb>>,
    model: Option<String>,
    denoised: Option<Denoised>,
}

impl Rest<'_> {
    fn drive<C: StoppingCriterion>(
        self,
        mut driver: Rendering<C>,
        snapshots: Option<Snapshots<C>>,
    ) -> anyhow::Result<ExitCode> {
        let Rest { job, began, scene, reference, model, denoised } = self;
        let info = driver.source().info();
        let snapshots = snapshots.filter(|_| info.repeats == Repeats::Samples);
        let resume = job.earlier == Earlier::Resume;
        if resume && snapshots.is_none() {
            bail!(
                "--resume: {} cannot be resumed, since it may repeat samples after a restart; leave it out",
                info.name
            )
        }
        let folder = job.out.clone().unwrap_or_else(|| PathBuf::from("out").join(&scene));
        let origin = origin(&job.source, &scene, &info);
        let folder = Folder::claim(folder)?;
        let mut output = Output::create(folder, job.earlier, scene, info.name, job.source.seed)?;
        (output.model, output.reference, output.origin) = (model, reference, origin);
        output.denoised = denoised;
        if let Some(snapshots) = snapshots.as_ref().filter(|_| resume) {
            driver = snapshots.resume(driver, &mut output, job.quiet)?;
        }
        driver.set_time_limit(job.time.map(|time| sampling_time(time, began, info.width * info.height)));
        let cancel = driver.cancel_flag();
        let flags = [Some(Arc::clone(&cancel)), output.denoised.as_ref().map(Denoised::give_up)];
        cancel_all_on_signal(flags.into_iter().flatten().collect(), AFTER_THIS_BATCH)?;
        driver.source_mut().watch_reference(reference_bar(job.quiet), Arc::clone(&cancel));
        let size = (info.width, info.height);
        let mut views = Views {
            tev: job.tev.as_deref().map(|address| Tev::open(address, &output.scene, size)).transpose()?,
            #[cfg(feature = "study")]
            page: job.watch.map(|address| watch::Page::serve(address, &output, job.quiet)).transpose()?,
        };
        let outcome = sample(&mut driver, &mut output, &mut views, snapshots.as_ref(), job);
        if let (Ok(()), Some(denoised)) = (&outcome, &output.denoised) {
            // Ended between two verdicts, the denoiser answers: the last picture is denoised, too
            denoised.give_up().store(false, Ordering::Relaxed);
        }

        // Write what there is, also after a failure.
        let checkpoint = snapshots.as_ref().map(|snapshots| snapshots.of(driver.session()));
        let over = (driver.clock(), driver.source().as_ref());
        let written = output.write(driver.session(), checkpoint, over);
        let interrupted = finish(&driver, outcome, &cancel)?;
        written?;
        if !job.quiet {
            output.summarise(driver.session(), driver.clock(), driver.source().as_ref())?;
        }
        let stopped = driver.session().stops().any(|s| s.reason == StopReason::Cancelled);
        Ok(if stopped || interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
    }
}

/// Where a render is watched.
struct Views {
    tev: Option<Tev>,
    #[cfg(feature = "study")]
    page: Option<watch::Page>,
}

impl Views {
    fn show<C: StoppingCriterion>(&mut self, session: &Session<C>, progress: &Progress) {
        tev::show(&mut self.tev, session, false);
        #[cfg(feature = "study")]
        if let Some(page) = &mut self.page {
            page.show(session, progress);
        }
        #[cfg(not(feature = "study"))]
        let _ = progress;
    }

    fn close<C: StoppingCriterion>(&mut self, session: &Session<C>) {
        tev::show(&mut self.tev, session, true);
        #[cfg(feature = "study")]
        if let Some(page) = &mut self.page {
            page.close(session);
        }
    }
}

/// What is left for samples of the time for everything, once all is set up: the files are still to be written. At least
/// half of it, so that there is something to write.
fn sampling_time(time: Duration, began: Instant, pixels: usize) -> Duration {
    let left = time.saturating_sub(began.elapsed());
    left.saturating_sub(saving::last_save(pixels)).max(left / 2)
}

/// Renders. A failure to save along the way is reported at once, and rendering goes on: the disk may have
/// room again.
fn sample<C: StoppingCriterion>(
    driver: &mut Rendering<C>,
    output: &mut Output,
    views: &mut Views,
    snapshots: Option<&Snapshots<C>>,
    job: &RenderJob,
) -> Result<(), DriverError> {
    let bar = progress::bar(job.quiet);
    let mut log = Log::new(job.quiet);
    let grid = driver.session().film().grid();
    let [mut checkpoints, mut pictures] = Pace::both(job.autosave, grid.width() * grid.height());
    let outcome = driver.run(|session, event| {
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
        save(&mut checkpoints, &mut |output| {
            output.write_progress(session, snapshots.map(|snapshots| snapshots.of(session)))
        });
    });
    bar.finish_and_clear();
    views.close(driver.session());
    outcome
}

/// Says what the user should know after the run, and whether Ctrl-C ended the source in the middle of a batch: in a
/// terminal it ends a command that renders, too, which is no failure.
fn finish<C: StoppingCriterion>(
    driver: &Rendering<C>,
    outcome: Result<(), DriverError>,
    cancel: &AtomicBool,
) -> anyhow::Result<bool> {
    driver.source().notes().iter().for_each(|text| note!("warning: {text}"));
    match outcome {
        Err(error) if cancel.load(Ordering::Relaxed) => {
            let what = if matches!(error, DriverError::Criterion(_)) { "verdict" } else { "batch" };
            note!("warning: the {what} under way is lost: {}", one_line(&error.into()));
            Ok(true)
        }
        outcome => Ok(outcome.map(|()| false)?),
    }
}
