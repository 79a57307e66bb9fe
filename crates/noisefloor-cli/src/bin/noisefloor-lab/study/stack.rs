//! `noisefloor-lab study stack`.

use crate::args::study::StackArgs;
use noisefloor::{Rgb, SourceInfo};
use noisefloor_cli::end::Usage;
use noisefloor_cli::folder::Folder;
use noisefloor_cli::say::one_line;
use noisefloor_cli::say::say;
use noisefloor_cli::signals::cancel_on_signal;
use noisefloor_cli::sources::{Opened, Source};
use noisefloor_denoise::{DenoisePasses, Denoiser, Guides, MirrorMean, NoisyPicture, OIDN, Oidn};
use noisefloor_image::LinearImage;
use noisefloor_image::running_means;
use noisefloor_sidecar::{FilterPlan, PictureCommand};
use noisefloor_study::{StudyError, render_stack};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// What is made of a level before it is written.
type Finish<'a> = Box<dyn FnMut(Vec<Rgb>) -> Result<Vec<Rgb>, StudyError> + 'a>;

pub(super) fn render(args: StackArgs) -> anyhow::Result<()> {
    let StackArgs { scene, renderer, levels, denoise, out } = args;
    // Levels between those rendered are synthesised: their noise has to fall as 1/√n
    let (job, resources) = renderer.independent_by_default().check(Some(&scene))?;
    // A program without its placeholders is refused before anything is opened
    let program = denoise.as_deref().filter(|word| *word != OIDN.name);
    let program = program.map(|word| PictureCommand::new(word, resources.timeout)).transpose()?;
    resources.start_threads()?;
    let opened = job.open(resources)?;
    opened.warn();
    let Opened { mut source, .. } = opened;
    let SourceInfo { width, height, .. } = source.info();
    let finish: Finish<'_> = match (&denoise, &program) {
        (None, _) => Box::new(Ok),
        (_, Some(program)) => Box::new(move |pixels| {
            let made = program.apply(&LinearImage { width, height, pixels });
            made.map(|image| image.pixels).map_err(|error| StudyError::Other(error.to_string()))
        }),
        (Some(_), None) => denoiser(source.as_mut(), job.first_hits_spp(), resources.timeout)?,
    };
    let folder = Folder::claim(out.clone())?;
    // Levels of two renders in one folder would be taken for one stack
    if running_means(folder.path()).is_ok() {
        let path = out.display();
        let what = format!(
            "{path}: holds a stack of pictures already; remove it, or choose another folder with --out"
        );
        return Err(Usage(what).into());
    }
    let cancel = Arc::new(AtomicBool::new(false));
    cancel_on_signal(Arc::clone(&cancel), "keeping the levels that are finished")?;
    let go_on = |_, _| !cancel.load(Ordering::Relaxed);
    render_stack(source.as_mut(), &levels, &out, go_on, finish)?;
    say!("written to {}", out.display())?;
    Ok(())
}

/// Open Image Denoise: what it lacks is found before anything is rendered. It gets albedo and normals as in
/// `render --denoise`, and the picture is the mean of mirror images, as there.
fn denoiser<'a>(source: &mut dyn Source, rays: u64, timeout: Duration) -> anyhow::Result<Finish<'a>> {
    let SourceInfo { width, height, .. } = source.info();
    let mut oidn = Oidn::start(FilterPlan { timeout, ..FilterPlan::default() })?;
    let guides = Guides::render(source, &mut oidn, rays)?;
    let guide = guides.map(|guides| (guides.together(), guides.is_clean()));
    let (wants, mut mean) = (oidn.wants(), MirrorMean::new(oidn, DenoisePasses::Four));
    Ok(Box::new(move |pixels| {
        let picture = NoisyPicture::new((width, height), &pixels);
        let guided = match &guide {
            Some((guide, clean)) => picture.guided(guide, *clean, wants),
            None => picture,
        };
        let made = mean.denoise(&guided);
        made.map_err(|error| StudyError::Other(one_line(&error.into())))
    }))
}
