//! `noisefloor reproduce`: the paper's own protocols, at its scale.

mod outcome;
mod pairs;
mod protocol;
mod report;
mod subset;

use crate::INTERRUPTED;
use crate::args::ReproduceArgs;
use crate::output::write_json;
use crate::train::bar;
use anyhow::Context;
use ndarray::Array2;
use noisefloor::{Descriptor, NoiseMask};
use noisefloor_image::{check_writable, write_atomic};
use noisefloor_learn::describe_pairs;
use outcome::{Fingerprint, Outcome};
use pairs::{Pairs, Scaling};
use protocol::Protocol;
use report::Report;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

/// The distances between all pairs of one representation, and what they cost.
pub struct Geometry {
    /// ‖x − y‖² of all rows: synthesised pairs, then real ones.
    pub squared: Array2<f64>,
    pub seconds: f64,
}

impl Geometry {
    fn of(pairs: &Pairs) -> Self {
        let bar = bar(0, "blocks of the matrix product");
        let begun = Instant::now();
        let squared = pairs.squared_distances(|done, all| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
        });
        bar.finish_and_clear();
        Self { squared, seconds: begun.elapsed().as_secs_f64() }
    }
}

pub fn run(args: &ReproduceArgs) -> anyhow::Result<ExitCode> {
    end_on_signal()?;
    let masks = Descriptor::MaskPair { mask: NoiseMask::default(), edge: args.edge };
    if let Some(count) = args.dump_subset {
        return subset::dump(&load(args, masks)?.into_pairs()?, count, &args.out).map(|()| ExitCode::SUCCESS);
    }
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("{}: the folder cannot be made", args.out.display()))?;
    let [json, markdown] = ["reproduce.json", "reproduce.md"].map(|name| args.out.join(name));
    check_writable(&json)?;

    let mut outcomes = Vec::new();
    for descriptor in [Descriptor::LuminancePair { edge: args.edge }, masks] {
        outcomes.extend(outcomes_of(args, descriptor)?);
    }
    let report = Report::new(args, outcomes);
    write_json(&json, &report)?;
    let text = report.markdown();
    write_atomic(&markdown, |to| to.write_all(text.as_bytes()))?;
    print!("{text}");
    Ok(ExitCode::SUCCESS)
}

/// All protocols on one representation, as far as they are not there already.
fn outcomes_of(args: &ReproduceArgs, descriptor: Descriptor) -> anyhow::Result<Vec<Outcome>> {
    let loaded = load(args, descriptor)?;
    let wanted = |scaling: Scaling| {
        Protocol::ALL.map(|protocol| Fingerprint::new(&loaded.digest, descriptor, scaling, protocol))
    };
    let path = |of: &Fingerprint| -> PathBuf { args.out.join(of.file_name()) };
    let known =
        Scaling::ALL.map(|scaling| (scaling, wanted(scaling).map(|of| Outcome::read(&path(&of), of))));
    let mut left = Some(loaded);
    let mut pairs: Option<Pairs> = None;

    let mut outcomes = Vec::new();
    for (scaling, known) in known {
        // What all protocols need costs most: computed once, and only if one of them is missing.
        let mut geometry = None;
        for known in known {
            let outcome = match known {
                Ok(outcome) => {
                    eprintln!("{} is there", path(&outcome.of).display());
                    outcome
                }
                Err(of) => {
                    if let Some(loaded) = left.take() {
                        pairs = Some(loaded.into_pairs()?);
                    }
                    let pairs = pairs.as_mut().context("the pairs have been loaded")?;
                    pairs.scale(scaling);
                    let geometry = geometry.get_or_insert_with(|| Geometry::of(pairs));
                    let (name, path) = (of.name(), path(&of));
                    write_json(&path, &Outcome::compute(of.clone(), pairs, geometry).context(name)?)?;
                    eprintln!("{} written", path.display());
                    // As the next run will read it: times may lose their last bit on the way.
                    Outcome::read(&path, of)
                        .ok()
                        .with_context(|| format!("{} has been changed", path.display()))?
                }
            };
            outcomes.push(outcome);
        }
    }
    Ok(outcomes)
}

fn load(args: &ReproduceArgs, descriptor: Descriptor) -> anyhow::Result<pairs::Loaded> {
    let bar = bar(0, "zones cut into pairs");
    let table = describe_pairs(&args.corpus, descriptor, args.edge, args.levels, |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    Ok(pairs::Loaded { digest: table.digest(), table })
}

/// Every result that is there has been written whole, so that there is nothing to save.
fn end_on_signal() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        eprintln!("\nstopped; finished results are kept, the same command goes on from there");
        std::process::exit(i32::from(INTERRUPTED));
    })
    .context("the handler for Ctrl-C could not be set")
}
