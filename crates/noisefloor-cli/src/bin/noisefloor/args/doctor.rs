//! `noisefloor doctor`.

use clap::{Args, ValueHint};
use noisefloor_cli::sources::Adapter;
use noisefloor_denoise::OIDN;
use noisefloor_sidecar::Renderer;

/// List the other renderers and denoisers, say what each one lacks here, or install one.
///
/// A renderer or denoiser runs in the Python that NOISEFLOOR_NAME_PYTHON names (such as
/// NOISEFLOOR_MITSUBA_PYTHON), otherwise in a private environment in the cache folder, which --install
/// makes with pinned packages. The exit code is 1 if a renderer is installed but does not load; one that is
/// not installed is no error.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor doctor
  noisefloor doctor --install mitsuba                 or luxcore, cycles, or the denoiser oidn")]
pub struct DoctorArgs {
    /// Install this renderer or denoiser, if it is not there yet.
    #[arg(long, value_name = "NAME", value_parser = installable, value_hint = ValueHint::Other)]
    pub install: Option<&'static Renderer>,
    /// Print JSON instead of a table.
    #[arg(long, conflicts_with = "install")]
    pub json: bool,
}

fn installable(text: &str) -> Result<&'static Renderer, String> {
    let denoiser = &OIDN;
    if text == denoiser.name {
        return Ok(denoiser);
    }
    let adapter: Result<&'static Adapter, String> = text.parse();
    adapter
        .map(|adapter| adapter.renderer)
        .map_err(|error| format!("{error}; the denoiser is {}", denoiser.name))
}
