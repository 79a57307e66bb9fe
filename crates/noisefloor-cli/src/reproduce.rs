//! `noisefloor reproduce`: the paper's own protocols, at its scale.

use crate::INTERRUPTED;
use crate::args::ReproduceArgs;
use crate::bars::Bars;
use anyhow::Context;
use noisefloor_image::check_writable;
use noisefloor_lab::Advance;
use noisefloor_lab::reproduce::{self, Reproduction, ResultState};
use std::path::Path;
use std::process::ExitCode;

pub fn run(args: &ReproduceArgs) -> anyhow::Result<ExitCode> {
    end_on_signal()?;
    let job = Reproduction { corpus: args.corpus.clone(), edge: args.edge, levels: args.levels };
    let bars = Bars::new(false);
    let watch = |advance: Advance<'_>| bars.show(advance);
    if let Some(count) = args.dump_subset {
        let subset = reproduce::subset(&job, count, &watch)?;
        bars.finish();
        reproduce::write_subset(&args.out, &subset)?;
        println!(
            "{count} pairs learned in {:.2} s, {} support vectors; rows.npy and machine.json written to {}",
            subset.seconds_training,
            subset.support_vectors,
            args.out.display()
        );
        return Ok(ExitCode::SUCCESS);
    }
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("{}: the folder cannot be made", args.out.display()))?;
    check_writable(args.out.join("reproduce.json"))?;
    let mut say = |path: &Path, state: ResultState| {
        let state = if state == ResultState::Kept { "is there" } else { "written" };
        bars.finish();
        eprintln!("{} {state}", path.display());
    };
    let report = reproduce::run(&job, &args.out, &mut say, &watch)?;
    bars.finish();
    reproduce::write_report(&args.out, &report)?;
    print!("{}", report.markdown());
    Ok(ExitCode::SUCCESS)
}

/// Every result that is there has been written whole, so that there is nothing to save.
fn end_on_signal() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        eprintln!("\nstopped; finished results are kept, the same command goes on from there");
        std::process::exit(i32::from(INTERRUPTED));
    })
    .context("the handler for Ctrl-C could not be set")
}
