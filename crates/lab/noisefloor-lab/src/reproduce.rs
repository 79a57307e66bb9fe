//! The protocols of Takouachet et al. 2017 (§4.3 to §5), at the scale of the paper, and what comes of them.
//!
//! The paper trains on pairs: a noisy tile and its reference, with C = 2 and γ = 2. [`run`] does so with
//! luminances and with noise masks, with values as displayed and standardised, by four ways to choose the
//! pairs that are asked about.

mod descriptors;
mod gram;
mod job;
mod outcome;
mod pairs;
mod protocol;
mod report;
mod solver;
#[cfg(test)]
mod tests;

pub use job::Reproduction;
pub use outcome::{Count, Fingerprint, MachineResult, ProtocolOutcome, QueryCost};
pub use pairs::PairScaling;
pub use protocol::PairProtocol;
pub use report::ReproductionReport;

use crate::advance::Watch;
use crate::error::LabError;
use crate::files::{make_folder, write_json, write_text};
use descriptors::luminance_pair;
use job::Geometry;
use noisefloor::descriptor::Descriptor;
use pairs::Loaded;
use std::path::Path;

/// Whether a result was computed now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResultState {
    Computed,
    /// It was there already.
    Kept,
}

/// Carries out all protocols. Creates the folder, and writes each result into it atomically as soon as it is
/// there. Results that are there already are not computed again. `on_result` gets each result, with its file.
pub fn run(
    job: &Reproduction,
    folder: &Path,
    on_result: &mut dyn FnMut(&Path, ResultState),
    watch: Watch<'_>,
) -> Result<ReproductionReport, LabError> {
    make_folder(folder)?;
    let mut outcomes = Vec::new();
    for descriptor in [luminance_pair(job.edge), job.masks()] {
        let loaded = job.load(&descriptor, watch)?;
        outcomes.extend(run_protocols(loaded, &descriptor, folder, on_result, watch)?);
    }
    Ok(ReproductionReport::new(job, outcomes))
}

pub fn write_report(folder: &Path, report: &ReproductionReport) -> Result<(), LabError> {
    write_json(&folder.join("reproduce.json"), report)?;
    write_text(&folder.join("reproduce.md"), &report.markdown())?;
    Ok(())
}

/// All protocols on one representation, as far as they are not there already.
fn run_protocols(
    loaded: Loaded,
    descriptor: &Descriptor,
    folder: &Path,
    on_result: &mut dyn FnMut(&Path, ResultState),
    watch: Watch<'_>,
) -> Result<Vec<ProtocolOutcome>, LabError> {
    let path = |of: &Fingerprint| folder.join(of.file_name());
    let wanted = PairScaling::ALL.into_iter().flat_map(|scaling| {
        PairProtocol::ALL.map(|protocol| Fingerprint::new(&loaded.digest, descriptor, scaling, protocol))
    });
    let known: Vec<_> = wanted.map(|of| ProtocolOutcome::read(&path(&of), of)).collect();

    // What all protocols of a scaling need costs most: computed once, and only if one of them is missing
    let mut pairs = if known.iter().any(Result::is_err) { Some(loaded.into_pairs()?) } else { None };
    let mut geometry: Option<(PairScaling, Geometry)> = None;
    let mut outcomes = Vec::new();
    for known in known {
        let outcome = match (known, &mut pairs) {
            (Ok(outcome), _) => {
                on_result(&path(&outcome.of), ResultState::Kept);
                outcome
            }
            (Err(of), Some(pairs)) => {
                pairs.scale(of.scaling);
                let scaling = of.scaling;
                let kept = geometry.take().filter(|(scaling, _)| *scaling == of.scaling);
                let kept = kept.map_or_else(|| Geometry::of(pairs, watch), |(_, geometry)| geometry);
                let path = path(&of);
                write_json(&path, &ProtocolOutcome::compute(of.clone(), pairs, &kept, watch)?)?;
                geometry = Some((scaling, kept));
                on_result(&path, ResultState::Computed);
                // As the next run will read it: times may lose their last bit on the way
                ProtocolOutcome::read(&path, of).map_err(|_| LabError::Changed { path })?
            }
            (Err(_), None) => continue, // there are pairs if a result is missing
        };
        outcomes.push(outcome);
    }
    Ok(outcomes)
}
