//! Options about denoisers.

use clap::ValueEnum;
use noisefloor_sidecar::FilterPlan;
use std::time::Duration;

/// The denoisers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum DenoiserChoice {
    /// Open Image Denoise.
    Oidn,
}

/// How a denoiser is run: on what, as it was typed, and for how long a call may take.
pub fn filter_plan(device: Option<&str>, timeout: Duration) -> anyhow::Result<FilterPlan> {
    let device = device.map(str::parse).transpose();
    let device = device.map_err(|error| anyhow::anyhow!("--denoise-device: {error}"))?;
    Ok(FilterPlan { device, timeout, ..FilterPlan::default() })
}
