//! `noisefloor-lab compare`: criteria side by side on one run.

use crate::bars::Bars;
use anyhow::Context;
use noisefloor::text::told_apart;
use noisefloor::{Params, SourceInfo, StoppingCriterion};
use noisefloor_cli::end::Usage;
use noisefloor_cli::files::read_reference;
use noisefloor_cli::folder::{Earlier, Folder};
use noisefloor_cli::say::{NotSaid, note, one_line, say};
use noisefloor_cli::signals::{AFTER_THIS_BATCH, INTERRUPTED, cancel_on_signal};
use noisefloor_cli::sources::{Opened, Resources, SourceJob};
use noisefloor_denoise::Denoiser;
use noisefloor_lab::compare::{
    self, AfterDenoising, Comparison, Converged, Cost, Course, CriterionRun, Entrant, Labels, ReferenceJob,
    render_reference,
};
use noisefloor_lab::{Advance, LabError};
use std::collections::HashSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A criterion, how it was asked for, and when it is to judge.
pub struct Named {
    pub spec: String,
    pub criterion: Box<dyn StoppingCriterion + Send>,
    pub params: Params,
}

/// What to compare, and on which scenes: checked.
pub struct CompareJob {
    pub scenes: Vec<OsString>,
    pub source: SourceJob,
    pub resources: Resources,
    pub out: PathBuf,
    /// Each scene has criteria of its own: they remember what they saw.
    pub criteria: Box<dyn Fn() -> anyhow::Result<Vec<Named>>>,
    /// Looks at every picture denoised, too.
    pub denoiser: Option<Box<dyn Denoiser>>,
    pub params: Params,
    pub batch: u64,
    pub reference: Option<PathBuf>,
    pub reference_spp: u64,
    pub pixels_per_degree: f64,
    pub earlier: Earlier,
    pub quiet: bool,
}

pub fn run(mut job: CompareJob) -> anyhow::Result<ExitCode> {
    let mut denoiser = job.denoiser.take();
    let job = &job;
    job.resources.start_threads()?;
    let folder = Folder::claim(job.out.clone())?;
    if job.earlier == Earlier::Keep && folder.first_of(&["index.html"]).is_some() {
        let path = job.out.display();
        let what = format!(
            "{path}: holds a comparison; --force overwrites it, \
             and uses its references where they still fit; --out names another folder"
        );
        return Err(Usage(what).into());
    }
    let cancel = Arc::new(AtomicBool::new(false));
    cancel_on_signal(Arc::clone(&cancel), AFTER_THIS_BATCH)?;

    let (mut all, mut sections) = (Vec::new(), Vec::new());
    let mut taken = HashSet::new();
    let names = told_apart(&job.scenes.iter().map(Path::new).collect::<Vec<_>>());
    for (scene, name) in job.scenes.iter().zip(&names) {
        let source = SourceJob { scene: Some(scene.into()), ..job.source.clone() };
        let (comparison, section) =
            match one(job, &source, name, &mut taken, denoiser.as_deref_mut(), &cancel) {
                Err(error) if matches!(error.downcast_ref(), Some(LabError::Cancelled { .. })) => {
                    note!("warning: {}", one_line(&error));
                    return Ok(ExitCode::from(INTERRUPTED));
                }
                outcome => outcome?,
            };
        let cancelled = comparison.cancelled;
        // All that there is so far, so that a page is there whatever comes after
        all.push(comparison);
        sections.push(section);
        compare::write_page(&job.out, &all, &sections, job.scenes.len())?;
        if cancelled {
            note!("warning: stopped early; what there is was written to {}", job.out.display());
            return Ok(ExitCode::from(INTERRUPTED));
        }
    }
    if !job.quiet {
        all.iter().try_for_each(say_runs)?;
        say!("written to {}", job.out.join("index.html").display())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Compares on one scene, which is called `name` if another has its own, and writes what is of that scene alone. With
/// its section of the page.
fn one(
    job: &CompareJob,
    source_job: &SourceJob,
    name: &str,
    taken: &mut HashSet<String>,
    denoiser: Option<&mut (dyn Denoiser + 'static)>,
    cancel: &AtomicBool,
) -> anyhow::Result<(Comparison, String)> {
    let opened = source_job.open(job.resources)?;
    opened.warn();
    let Opened { mut source, mut scene, .. } = opened;
    // Each scene has a folder of its own
    if !taken.insert(scene.clone()) {
        scene = name.replace(['/', '\\'], "-");
        taken.insert(scene.clone());
    }
    let SourceInfo { width, height, .. } = source.info();
    let folder = job.out.join(&scene);
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;

    let entrant = |Named { spec, criterion, params }| Entrant::new(spec, criterion, (width, height), &params);
    let entrants = (job.criteria)()?.into_iter().map(entrant).collect::<Result<Vec<_>, _>>()?;
    let bars = Bars::new(job.quiet);
    let watch = |advance: Advance<'_>| bars.show(advance);
    let truth = converged(job, source_job, &folder, (width, height), cancel, &watch)?;
    let course = Course {
        params: &job.params,
        batch: job.batch,
        reference: &truth.pixels,
        pixels_per_degree: job.pixels_per_degree,
        cancel,
        watch: &watch,
    };
    let labels = Labels { scene, reference: truth.origin };
    let denoiser = denoiser.map(|denoiser| denoiser as &mut dyn Denoiser);
    let (comparison, pictures) = compare::run(source.as_mut(), entrants, course, labels, denoiser)?;
    bars.finish();
    comparison.warnings.iter().for_each(|warning| note!("warning: {warning}"));

    let plot = |cost| Ok((cost, compare::plot(&comparison, cost)?));
    let plots: Vec<_> = Cost::ALL.into_iter().map(plot).collect::<anyhow::Result<_>>()?;
    compare::write_scene(&folder, &comparison, &pictures, &plots)?;
    let section = compare::section(&comparison, &pictures, &plots)?;
    Ok((comparison, section))
}

/// Samples of a reference have a seed of their own, so that no run shares any with it.
const SEED: u64 = 0x5eed_0f7e_0000_0000;

/// The picture that `--reference` names, or one with `--reference-spp` samples, resumed from what is in the
/// folder.
fn converged(
    job: &CompareJob,
    source: &SourceJob,
    folder: &Path,
    size: (usize, usize),
    cancel: &AtomicBool,
    watch: &(dyn Fn(Advance<'_>) + Sync),
) -> anyhow::Result<Converged> {
    if let Some(path) = &job.reference {
        return Ok(Converged { pixels: read_reference(path, size)?, origin: path.display().to_string() });
    }
    let source = SourceJob { seed: source.seed ^ SEED, ..source.clone() };
    let overwrite = job.earlier == Earlier::Overwrite;
    let reference = ReferenceJob { folder, tile: job.params.tile, spp: job.reference_spp, overwrite };
    Ok(render_reference(source.open(job.resources)?.source.as_mut(), &reference, cancel, watch)?)
}

fn say_runs(compared: &Comparison) -> Result<(), NotSaid> {
    say!("{} by {}, against {}", compared.scene, compared.source, compared.reference)?;
    say!(
        "{:24} {:>8} {:>6} {:>9} {:>9} {:>9}  {:>7} {:>7} {:>7} {:>6} {:>6} {:>7}  uniform for the same worst tile",
        "criterion",
        "spp mean",
        "most",
        "satisfied",
        "source s",
        "criter. s",
        "relMSE",
        "FLIP",
        "worst",
        "JOD",
        "worst",
        "butter."
    )?;
    for CriterionRun { taken, quality, against, denoised } in &compared.runs {
        say!(
            "{:24} {:8.0} {:6} {:>9} {:9.2} {:9.3}  {:7.5} {:7.4} {:7.4} {:6.3} {:6.3} {:7.3}  {}",
            taken.criterion,
            taken.spp_mean,
            taken.spp_most,
            format!("{}/{}", taken.tiles_converged, taken.tiles),
            taken.source_seconds,
            taken.criterion_seconds,
            quality.rel_mse,
            quality.flip,
            quality.flip_worst,
            quality.cvvdp_jod,
            quality.cvvdp_jod_worst,
            quality.butteraugli_worst,
            against.uniform_over_this.map_or_else(|| "–".to_owned(), |ratio| format!("×{ratio:.2}")),
        )?;
        if let Some(AfterDenoising { seconds, jod, jod_worst: worst }) = denoised {
            let seconds = taken.seconds() + seconds;
            say!("{:24} denoised: JOD {jod:.3}, worst tile {worst:.3}, {seconds:.2} s in all", "")?;
        }
    }
    Ok(())
}
