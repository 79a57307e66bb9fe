//! `render --denoise`: a criterion and the denoiser that it shares with the output.

use crate::job::FIRST_DENOISED;
use crate::output::Denoised;
use noisefloor::{ProgressiveSource, Session, StoppingCriterion};
use noisefloor_cli::say::{note, say};
use noisefloor_denoise::{
    DEFAULT_JODS_LOST, DenoisePasses, DenoisedQuality, Guides, MirrorMean, Oidn, spp_with_denoising,
};
use noisefloor_sidecar::FilterPlan;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Renders below this say nothing of what denoising would have saved.
const LONG: Duration = Duration::from_secs(30);
/// What is saved must be more than the estimate may be wrong by.
const WORTH_SAYING: f64 = 2.0;

/// Starts the denoiser. First hits take at most so many rays, a tile may lose so many JODs.
pub(super) fn begin(
    source: &mut impl ProgressiveSource,
    rays: u64,
    lost: f64,
    passes: DenoisePasses,
    plan: FilterPlan,
) -> anyhow::Result<(Box<dyn StoppingCriterion + Send>, Denoised)> {
    let (mut denoiser, give_up) = (Oidn::start(plan)?, Arc::<AtomicBool>::default());
    denoiser.warnings().iter().for_each(|warning| note!("warning: {warning}"));
    denoiser.give_up_when(Arc::clone(&give_up));
    let mut denoiser = Arc::new(Mutex::new(denoiser));
    let mut criterion = DenoisedQuality::new(Arc::clone(&denoiser), lost).shown_as_mean_of(passes);
    let guides = Guides::render(source, &mut denoiser, rays)?.map(Arc::new);
    if let Some(guides) = &guides {
        criterion = criterion.guided_by(Arc::clone(guides));
    }
    let finished = MirrorMean::new(denoiser, passes);
    let denoised = Denoised::new(finished, guides.as_deref(), give_up, lost);
    Ok((Box::new(criterion), denoised))
}

/// Says what a render whose noise was judged would have taken with a denoiser, if one is installed. The answer costs a
/// second or two, so nobody gets it who has waited for less than [`LONG`].
pub(super) fn say_what_it_would_save(session: &Session, took: Duration) -> anyhow::Result<()> {
    let Some(display) = session.display().filter(|_| took >= LONG) else { return Ok(()) };
    let plan = FilterPlan { timeout: LONG, ..FilterPlan::default() };
    // Whoever has none has not asked for one
    let Ok(denoiser) = Oidn::start(plan) else { return Ok(()) };
    let (film, viewing) = (session.film(), session.params().viewing);
    let Ok(Some(spp)) = spp_with_denoising(film, display, denoiser, viewing, DEFAULT_JODS_LOST) else {
        return Ok(());
    };
    let pixels = film.grid().width() * film.grid().height();
    let spp = spp.max(FIRST_DENOISED as f64);
    let times = film.total_samples() as f64 / pixels as f64 / spp;
    if times > WORTH_SAYING {
        say!("--denoise oidn would have taken about {spp:.0} samples per pixel, {times:.1} times fewer")?;
    }
    Ok(())
}
