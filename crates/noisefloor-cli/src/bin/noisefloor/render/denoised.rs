//! `render --denoise`: a criterion and the denoiser that it shares with the output.

use crate::output::Denoised;
use noisefloor::{ProgressiveSource, SourceError, StoppingCriterion, source::FirstHits};
use noisefloor_cli::sources::FIRST_HITS_SPP;
use noisefloor_denoise::{AuxiliaryPictures, DenoisedQuality, Denoiser, Oidn};
use noisefloor_sidecar::FilterPlan;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Starts the denoiser. A tile may lose so many JODs, and a call may take so long.
pub(super) fn begin(
    source: &mut impl ProgressiveSource,
    lost: f64,
    timeout: Duration,
) -> anyhow::Result<(Box<dyn StoppingCriterion + Send>, Denoised)> {
    let plan = FilterPlan { timeout, ..FilterPlan::default() };
    let (mut denoiser, give_up) = (Oidn::start(plan)?, Arc::<AtomicBool>::default());
    denoiser.give_up_when(Arc::clone(&give_up));
    let denoiser = Arc::new(Mutex::new(denoiser));
    let mut criterion = DenoisedQuality::new(Arc::clone(&denoiser), lost);
    let guides = guides(source, denoiser.wants())?;
    if let Some(guides) = &guides {
        criterion = criterion.guided_by(Arc::clone(guides));
    }
    let denoised = Denoised::new(denoiser, guides.as_deref(), criterion.record(), give_up, lost);
    Ok((Box::new(criterion), denoised))
}

/// Albedo and normals for each half, if the denoiser makes use of them and the source has them.
fn guides(
    source: &mut impl ProgressiveSource,
    wants: AuxiliaryPictures,
) -> Result<Option<Arc<[FirstHits; 2]>>, SourceError> {
    if !wants.any() {
        return Ok(None);
    }
    let Some(a) = source.first_hits(0, FIRST_HITS_SPP)? else { return Ok(None) };
    Ok(source.first_hits(1, FIRST_HITS_SPP)?.map(|b| Arc::new([a, b])))
}
