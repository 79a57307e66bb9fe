//! `noisefloor-lab study stack`.

use noisefloor::{Rgb, SourceInfo};
use noisefloor_cli::end::Usage;
use noisefloor_cli::folder::Folder;
use noisefloor_cli::say::one_line;
use noisefloor_cli::say::say;
use noisefloor_cli::signals::cancel_on_signal;
use noisefloor_cli::sources::{Opened, Resources, Source, SourceJob};
use noisefloor_denoise::{DenoisePasses, Denoiser, Guides, MirrorMean, NoisyPicture, Oidn};
use noisefloor_image::LinearImage;
use noisefloor_image::running_means;
use noisefloor_sidecar::{FilterPlan, PictureCommand};
use noisefloor_study::{StudyError, render_stack};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

pub struct StackJob {
    pub source: SourceJob,
    pub resources: Resources,
    pub levels: Vec<u64>,
    /// What all levels but the last pass through.
    pub denoise: Option<StackDenoiser>,
    pub out: PathBuf,
}

/// What the levels of a stack pass through.
pub enum StackDenoiser {
    /// Open Image Denoise, with a time limit for one picture.
    Oidn {
        timeout: Duration,
    },
    Program(PictureCommand),
}

/// What is made of a level before it is written.
type Finish<'a> = Box<dyn FnMut(Vec<Rgb>) -> Result<Vec<Rgb>, StudyError> + 'a>;

pub(super) fn render(job: &StackJob) -> anyhow::Result<()> {
    job.resources.start_threads()?;
    let opened = job.source.open(job.resources)?;
    opened.warn();
    let Opened { mut source, .. } = opened;
    let SourceInfo { width, height, .. } = source.info();
    let finish = finish(job, source.as_mut(), (width, height))?;
    let folder = Folder::claim(job.out.clone())?;
    // Levels of two renders in one folder would be taken for one stack
    if running_means(folder.path()).is_ok() {
        let path = job.out.display();
        let what = format!(
            "{path}: holds a stack of pictures already; remove it, or choose another folder with --out"
        );
        return Err(Usage(what).into());
    }
    let cancel = Arc::new(AtomicBool::new(false));
    cancel_on_signal(Arc::clone(&cancel), "keeping the levels that are finished")?;
    let go_on = |_, _| !cancel.load(Ordering::Relaxed);
    render_stack(source.as_mut(), &job.levels, &job.out, go_on, finish)?;
    say!("written to {}", job.out.display())?;
    Ok(())
}

/// Starts the denoiser, if there is one: what it lacks is found before anything is rendered. It gets albedo
/// and normals as in `render --denoise`, and the picture is the mean of mirror images, as there.
fn finish<'a>(
    job: &'a StackJob,
    source: &mut dyn Source,
    (width, height): (usize, usize),
) -> anyhow::Result<Finish<'a>> {
    Ok(match &job.denoise {
        None => Box::new(Ok),
        Some(StackDenoiser::Oidn { timeout }) => {
            let mut oidn = Oidn::start(FilterPlan { timeout: *timeout, ..FilterPlan::default() })?;
            let guides = Guides::render(source, &mut oidn, job.source.first_hits_spp())?;
            let guide = guides.map(|guides| (guides.together(), guides.is_clean()));
            let (wants, mut mean) = (oidn.wants(), MirrorMean::new(oidn, DenoisePasses::Four));
            Box::new(move |pixels| {
                let picture = NoisyPicture::new((width, height), &pixels);
                let guided = match &guide {
                    Some((guide, clean)) => picture.guided(guide, *clean, wants),
                    None => picture,
                };
                let made = mean.denoise(&guided);
                made.map_err(|error| StudyError::StackRender(one_line(&error.into())))
            })
        }
        Some(StackDenoiser::Program(program)) => Box::new(move |pixels| {
            let made = program.apply(&LinearImage { width, height, pixels });
            made.map(|image| image.pixels).map_err(|error| StudyError::StackRender(error.to_string()))
        }),
    })
}
