//! `noisefloor reference`.

use crate::args::ReferenceArgs;
use crate::output::summary::say_noise;
use crate::render::reference_bar;
use anyhow::Context;
use noisefloor::{Rgb, ToneMapping, source::Reference};
use noisefloor_cli::refuse;
use noisefloor_cli::say::{note, one_line, say};
use noisefloor_cli::signals::{INTERRUPTED, cancel_on_signal};
use noisefloor_cli::sources::Opened;
use noisefloor_image::maps::Canvas;
use noisefloor_image::{RenderLayers, check_writable, write_exr};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

pub fn run(job: ReferenceArgs) -> anyhow::Result<ExitCode> {
    if let Some(out) = &job.out
        && out.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("exr"))
    {
        refuse!("{}: the reference is written as EXR, so its name must end in .exr", out.display());
    }
    let (source, resources) = job.renderer.check(Some(&job.scene))?;
    resources.start_threads()?;
    let opened = source.open(resources)?;
    opened.warn();
    let Opened { mut source, scene, .. } = opened;
    let out = match job.out {
        Some(out) => out,
        None => {
            std::fs::create_dir_all("out").context("out: this folder cannot be made")?;
            PathBuf::from(format!("out/{scene}-reference.exr"))
        }
    };
    if !job.force && out.exists() {
        refuse!("{}: exists; --force overwrites it, --out names another file", out.display());
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
