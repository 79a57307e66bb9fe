//! `noisefloor reference`.

use crate::INTERRUPTED;
use crate::args::ReferenceArgs;
use crate::output::say_noise;
use crate::render::{cancel_on_signal, reference_bar};
use crate::sources::{self, Opened};
use anyhow::{Context, bail};
use noisefloor::{Reference, ToneMapping};
use noisefloor_image::maps::display_bytes;
use noisefloor_image::{RenderLayers, check_writable, write_exr, write_png};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

pub fn run(args: &ReferenceArgs) -> anyhow::Result<ExitCode> {
    args.renderer.set_threads()?;
    let Opened { mut source, scene, warnings } = sources::open(Some(&args.scene), &args.renderer)?;
    if !args.quiet {
        warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    }
    let out = match &args.out {
        Some(out) => out.clone(),
        None => {
            std::fs::create_dir_all("out").context("out: cannot be made")?;
            PathBuf::from(format!("out/{scene}-reference.exr"))
        }
    };
    if out.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("exr")) {
        bail!("{}: the reference is written as EXR; give a name that ends in .exr", out.display());
    }
    check_writable(&out)?;

    let cancel = Arc::new(AtomicBool::new(false));
    cancel_on_signal(Arc::clone(&cancel), "giving the reference up")?;
    source.watch_reference(reference_bar(args.quiet), Arc::clone(&cancel));
    let start = Instant::now();
    let Reference { width, height, pixels } = match source.reference() {
        Err(error) if cancel.load(Ordering::Relaxed) => {
            eprintln!("warning: nothing was written: {}", crate::one_line(&error.into()));
            return Ok(ExitCode::from(INTERRUPTED));
        }
        reference => reference?.with_context(|| {
            format!("{} has no quick reference; the built-in path tracer has", source.info().name)
        })?,
    };
    write_exr(&out, &RenderLayers::rgb(width, height, &pixels))?;
    let display = ToneMapping::default().settle(&pixels);
    let shown: Vec<_> = pixels.iter().map(|&pixel| display.encode(pixel)).collect();
    write_png(out.with_extension("png"), width, height, &display_bytes(&shown))?;

    if !args.quiet {
        source.reference_noise().into_iter().for_each(say_noise);
        println!("{:.1} s, written to {}", start.elapsed().as_secs_f64(), out.display());
    }
    Ok(ExitCode::SUCCESS)
}
