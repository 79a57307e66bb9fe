//! `noisefloor-lab reproduce`: the paper's own protocols, at its scale.

use crate::args::ReproduceArgs;
use crate::bars::Bars;
use anyhow::Context;
use noisefloor_cli::say::{note, print};
use noisefloor_cli::signals::end_on_signal;
use noisefloor_image::check_writable;
use noisefloor_lab::Advance;
use noisefloor_lab::reproduce::{self, Reproduction, ResultState};
use std::path::Path;

pub fn run(args: ReproduceArgs) -> anyhow::Result<()> {
    let ReproduceArgs { corpus, out, edge, levels } = args;
    let what = Reproduction { corpus, edge, levels };
    // Every result that is there has been written whole, so that there is nothing to save.
    end_on_signal("stopped; finished results are kept, and the same command continues from there")?;
    let bars = Bars::new(false);
    let watch = |advance: Advance<'_>| bars.show(advance);
    std::fs::create_dir_all(&out)
        .with_context(|| format!("{}: this folder cannot be made", out.display()))?;
    check_writable(out.join("reproduce.json"))?;
    let mut tell = |path: &Path, state: ResultState| {
        let state = if state == ResultState::Kept { "is there" } else { "written" };
        bars.finish();
        note!("{} {state}", path.display());
    };
    let report = reproduce::run(&what, &out, &mut tell, &watch)?;
    bars.finish();
    reproduce::write_report(&out, &report)?;
    print(format_args!("{}", report.markdown()))?;
    Ok(())
}
