//! `noisefloor compare`: criteria side by side on one run.

use crate::INTERRUPTED;
use crate::args::{CompareArgs, RendererArgs};
use crate::bars::Bars;
use crate::output::read_reference;
use crate::render::{AFTER_THIS_BATCH, cancel_on_signal};
use crate::sources::{self, Opened};
use anyhow::{Context, bail};
use noisefloor::{Params, Schedule, SourceInfo, StoppingCriterion};
use noisefloor_lab::compare::{
    self, Comparison, Converged, Cost, Entrant, Labels, ReferenceJob, Setting, render_reference,
};
use noisefloor_rivals::RIVALS;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

pub fn run(args: &CompareArgs) -> anyhow::Result<ExitCode> {
    let params = params(args)?;
    if args.reference.is_some() && args.scenes.len() > 1 {
        bail!("--reference is of one scene; {} are given", args.scenes.len());
    }
    args.renderer.set_threads()?;
    std::fs::create_dir_all(&args.out).with_context(|| {
        format!("{}: cannot make this folder; choose another with --out", args.out.display())
    })?;
    let cancel = Arc::new(AtomicBool::new(false));
    cancel_on_signal(Arc::clone(&cancel), AFTER_THIS_BATCH)?;

    let (mut all, mut sections) = (Vec::new(), Vec::new());
    for scene in &args.scenes {
        let (comparison, section) = one(args, scene, &params, &cancel)?;
        let cancelled = comparison.cancelled;
        // All that there is so far, so that a page is there whatever comes after.
        all.push(comparison);
        sections.push(section);
        compare::write_page(&args.out, &all, &sections)?;
        if cancelled {
            eprintln!("warning: broken off; what is there is in {}", args.out.display());
            return Ok(ExitCode::from(INTERRUPTED));
        }
    }
    if !args.quiet {
        all.iter().for_each(print);
        println!("written to {}", args.out.join("index.html").display());
    }
    Ok(ExitCode::SUCCESS)
}

/// Session parameters, checked.
fn params(args: &CompareArgs) -> anyhow::Result<Params> {
    let params = Params {
        tile: args.tile,
        tone_mapping: args.tone.check()?,
        schedule: Schedule::Every { step: args.batch },
        max_spp: args.max_spp,
        ..Params::default()
    };
    params.check().with_context(|| {
        format!("--tile {}, --batch {}, --max-spp {}", args.tile, args.batch, args.max_spp)
    })?;
    Ok(params)
}

/// Every criterion that was asked for, and the same ones at other constants if a sweep was.
fn criteria(args: &CompareArgs) -> anyhow::Result<Vec<(String, Box<dyn StoppingCriterion + Send>)>> {
    let mut all: Vec<(String, Box<dyn StoppingCriterion + Send>)> = Vec::new();
    for spec in &args.criteria {
        all.push((spec.clone(), criterion(spec, args)?));
        let Some(rival) = RIVALS.iter().find(|rival| rival.name == spec) else { continue };
        let (strict, lax) = rival.range;
        for i in 0..args.sweep {
            let place = (f64::from(i) + 0.5) / f64::from(args.sweep);
            let constant = strict * (lax / strict).powf(place);
            // Rounded, so that what is said is what was used.
            let spec = format!("{}:{constant:.2e}", rival.name);
            all.push((spec.clone(), criterion(&spec, args)?));
        }
    }
    Ok(all)
}

/// The criterion of a specification.
fn criterion(spec: &str, args: &CompareArgs) -> anyhow::Result<Box<dyn StoppingCriterion + Send>> {
    Ok(if spec == "oracle" { Box::new(args.oracle.load()?) } else { noisefloor_rivals::parse(spec)? })
}

/// Compares on one scene, and writes what is of that scene alone. With its section of the page.
fn one(
    args: &CompareArgs,
    scene: &str,
    params: &Params,
    cancel: &AtomicBool,
) -> anyhow::Result<(Comparison, String)> {
    let Opened { mut source, scene: name, warnings } = sources::open(Some(scene), &args.renderer)?;
    if !args.quiet {
        warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    }
    let SourceInfo { width, height, .. } = source.info();
    let folder = args.out.join(&name);
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;

    // What is wrong with a criterion is found before the reference is rendered.
    let entrants = criteria(args)?
        .into_iter()
        .map(|(spec, criterion)| Entrant::new(spec, criterion, (width, height), params))
        .collect::<Result<Vec<_>, _>>()?;
    let bars = Bars::new(args.quiet);
    let truth = converged(args, scene, &folder, (width, height), cancel, &bars)?;
    let setting = Setting {
        params,
        batch: args.batch,
        reference: &truth.pixels,
        pixels_per_degree: args.pixels_per_degree,
    };
    let labels = Labels { scene: name, reference: truth.origin };
    let watch = |advance: noisefloor_lab::Advance<'_>| bars.show(advance);
    let (comparison, pictures) = compare::run(source.as_mut(), entrants, setting, labels, cancel, &watch)?;
    bars.finish();

    let plots: Vec<_> = Cost::ALL
        .into_iter()
        .map(|cost| Ok((cost, compare::plot(&comparison, cost)?)))
        .collect::<anyhow::Result<_>>()?;
    compare::write_scene(&folder, &comparison, &pictures, &plots)?;
    let section = compare::section(&comparison, &pictures, &plots)?;
    Ok((comparison, section))
}

/// Samples of a reference have a seed of their own, so that no run shares any with it.
const SEED: u64 = 0x5eed_0f7e_0000_0000;

/// The picture that `--reference` names, or one with `--reference-spp` samples, rendered on from what is in the folder.
fn converged(
    args: &CompareArgs,
    scene: &str,
    folder: &Path,
    size: (usize, usize),
    cancel: &AtomicBool,
    bars: &Bars,
) -> anyhow::Result<Converged> {
    if let Some(path) = &args.reference {
        return Ok(Converged { pixels: read_reference(path, size)?, origin: path.display().to_string() });
    }
    let renderer = RendererArgs { seed: args.renderer.seed ^ SEED, ..args.renderer.clone() };
    let Opened { mut source, .. } = sources::open(Some(scene), &renderer)?;
    let job = ReferenceJob {
        folder,
        scene,
        seed: renderer.seed,
        max_depth: renderer.max_depth,
        filter: format!("{:?}", renderer.filter),
        clamp: renderer.clamp,
        tile: args.tile,
        spp: args.reference_spp,
    };
    let watch = |advance: noisefloor_lab::Advance<'_>| bars.show(advance);
    let truth = render_reference(source.as_mut(), &job, cancel, &watch)?;
    bars.finish();
    Ok(truth)
}

fn print(compared: &Comparison) {
    println!("{} by {}, against {}", compared.scene, compared.source, compared.reference);
    println!(
        "{:24} {:>8} {:>6} {:>9} {:>9} {:>9}  {:>7} {:>7} {:>7} {:>7}  uniform for the same worst tile",
        "criterion",
        "spp mean",
        "most",
        "satisfied",
        "source s",
        "criter. s",
        "relMSE",
        "FLIP",
        "worst",
        "butter."
    );
    for run in &compared.runs {
        println!(
            "{:24} {:8.0} {:6} {:>9} {:9.2} {:9.3}  {:7.5} {:7.4} {:7.4} {:7.3}  {}",
            run.criterion,
            run.spp_mean,
            run.spp_most,
            format!("{}/{}", run.tiles_converged, run.tiles),
            run.source_seconds,
            run.criterion_seconds,
            run.rel_mse,
            run.flip,
            run.flip_worst,
            run.butteraugli_worst,
            run.uniform_over_this.map_or_else(|| "–".to_owned(), |ratio| format!("×{ratio:.2}")),
        );
    }
}
