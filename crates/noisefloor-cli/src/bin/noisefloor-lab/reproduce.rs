//! `noisefloor-lab reproduce`: the paper's own protocols, at its scale.

use crate::bars::Bars;
use anyhow::Context;
use noisefloor_cli::say::{note, print, say};
use noisefloor_cli::signals::end_on_signal;
use noisefloor_image::check_writable;
use noisefloor_lab::Advance;
use noisefloor_lab::reproduce::{self, Reproduction, ResultState};
use std::path::{Path, PathBuf};

/// What to reproduce, and where to: checked.
pub struct ReproduceJob {
    pub what: Reproduction,
    pub out: PathBuf,
    /// Only so many pairs, for other programs.
    pub subset: Option<usize>,
}

pub fn run(job: &ReproduceJob) -> anyhow::Result<()> {
    // Every result that is there has been written whole, so that there is nothing to save.
    end_on_signal("stopped; finished results are kept, and the same command continues from there")?;
    let bars = Bars::new(false);
    let watch = |advance: Advance<'_>| bars.show(advance);
    if let Some(count) = job.subset {
        let subset = reproduce::subset(&job.what, count, &watch).context("--dump-subset")?;
        bars.finish();
        reproduce::write_subset(&job.out, &subset)?;
        say!(
            "{count} pairs learned in {:.2} s, {} support vectors; rows.npy and machine.json written to {}",
            subset.seconds_training,
            subset.support_vectors,
            job.out.display()
        )?;
        return Ok(());
    }
    std::fs::create_dir_all(&job.out)
        .with_context(|| format!("{}: this folder cannot be made", job.out.display()))?;
    check_writable(job.out.join("reproduce.json"))?;
    let mut tell = |path: &Path, state: ResultState| {
        let state = if state == ResultState::Kept { "is there" } else { "written" };
        bars.finish();
        note!("{} {state}", path.display());
    };
    let report = reproduce::run(&job.what, &job.out, &mut tell, &watch)?;
    bars.finish();
    reproduce::write_report(&job.out, &report)?;
    print(format_args!("{}", report.markdown()))?;
    Ok(())
}
