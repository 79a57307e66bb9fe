//! `noisefloor reference`.

use crate::output::say_noise;
use crate::render::reference_bar;
use anyhow::Context;
use noisefloor::{Rgb, ToneMapping, source::Reference};
use noisefloor_cli::end::Usage;
use noisefloor_cli::folder::Earlier;
use noisefloor_cli::say::{note, one_line, say};
use noisefloor_cli::signals::{INTERRUPTED, cancel_on_signal};
use noisefloor_cli::sources::{Opened, Resources, SourceJob};
use noisefloor_image::maps::Canvas;
use noisefloor_image::{RenderLayers, check_writable, write_exr};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

pub struct ReferenceJob {
    pub source: SourceJob,
    pub resources: Resources,
    /// Ends in .exr.
    pub out: Option<PathBuf>,
    pub earlier: Earlier,
    pub quiet: bool,
}

pub fn run(job: ReferenceJob) -> anyhow::Result<ExitCode> {
    job.resources.start_threads()?;
    let opened = job.source.open(job.resources)?;
    opened.warn();
    let Opened { mut source, scene, .. } = opened;
    let out = match job.out {
        Some(out) => out,
        None => {
            std::fs::create_dir_all("out").context("out: this folder cannot be made")?;
            PathBuf::from(format!("out/{scene}-reference.exr"))
        }
    };
    if job.earlier == Earlier::Keep && out.exists() {
        let what = format!("{}: exists; --force overwrites it, --out names another file", out.display());
        return Err(Usage(what).into());
    }
    check_writable(&out)?;

    let cancel = Arc::new(AtomicBool::new(false));
    cancel_on_signal(Arc::clone(&cancel), "stopping; nothing will be written")?;
    source.watch_reference(reference_bar(job.quiet), Arc::clone(&cancel));
    let start = Instant::now();
    let Reference { width, height, pixels, .. } = match source.reference() {
        Err(error) if cancel.load(Ordering::Relaxed) => {
            note!("warning: nothing was written: {}", one_line(&error.into()));
            return Ok(ExitCode::from(INTERRUPTED));
        }
        reference => reference?.with_context(|| {
            format!("{} has no quick reference; only the built-in path tracer has one", source.info().name)
        })?,
    };
    write_exr(&out, &RenderLayers::rgb(width, height, &pixels))?;
    let display = ToneMapping::default().settle(&pixels);
    let shown: Vec<Rgb> = pixels.iter().map(|&pixel| display.encode(pixel)).collect();
    Canvas::of_picture(width, &shown).save(out.with_extension("png"))?;

    if !job.quiet {
        source.reference_noise().map_or(Ok(()), say_noise)?;
        say!("{:.1} s, written to {}", start.elapsed().as_secs_f64(), out.display())?;
    }
    Ok(ExitCode::SUCCESS)
}
