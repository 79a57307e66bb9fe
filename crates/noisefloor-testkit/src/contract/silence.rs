//! A session finds nothing wrong with a source.

use noisefloor::{Driver, FixedSpp, Params, ProgressiveSource, Schedule, watch::Warning};

/// Renders so many samples per pixel and looks after every 20 at what [`noisefloor::watch`] says of them. Two
/// warnings are no fault of a source: that a picture has one value everywhere, and that batches complement each
/// other, as those of one Sobol sequence do.
///
/// # Panics
/// If anything else is said.
pub fn check_silence(source: impl ProgressiveSource, spp: u64) {
    let name = source.info().name;
    let params = Params::default().with_tile(32).with_schedule(Schedule::Every { step: 20 }).with_min_spp(0);
    let driver = Driver::new(source, FixedSpp(spp), params.with_max_spp(spp));
    let mut driver = driver.unwrap_or_else(|error| panic!("{name}: {error}"));
    driver.run(|_, _| ()).unwrap_or_else(|error| panic!("{name}: {error}"));
    let harmless = |warning: &&Warning| matches!(warning, Warning::Anticorrelated(_) | Warning::Constant(_));
    let said: Vec<_> = driver.session().warnings().iter().filter(|warning| !harmless(warning)).collect();
    assert!(said.is_empty(), "{name}: {said:?}");
}
