//! `noisefloor doctor`.

use clap::Args;

/// List the other renderers and denoisers, say what each one lacks here, or install one.
///
/// A renderer or denoiser runs in the Python that NOISEFLOOR_NAME_PYTHON names (such as NOISEFLOOR_MITSUBA_PYTHON),
/// otherwise in a private environment in the cache folder, which --install makes with pinned packages. The
/// exit code is 1 if a renderer is installed but does not load; one that is not installed is no error.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor doctor
  noisefloor doctor --install mitsuba                 or luxcore, cycles, or the denoiser oidn")]
pub struct DoctorArgs {
    /// Install this renderer or denoiser, if it is not there yet.
    #[arg(long, value_name = "NAME")]
    #[cfg_attr(feature = "adapters", arg(value_parser = installable))]
    install: Option<Installable>,
}

#[cfg(feature = "adapters")]
type Installable = &'static noisefloor_sidecar::Renderer;
#[cfg(not(feature = "adapters"))]
type Installable = String;

#[cfg(feature = "adapters")]
fn installable(text: &str) -> Result<Installable, String> {
    let denoiser = &noisefloor_denoise::OIDN;
    if text == denoiser.name {
        return Ok(denoiser);
    }
    let with_denoiser = |error| format!("{error}; the denoiser is {}", denoiser.name);
    adapter(text).map(|adapter| adapter.renderer).map_err(with_denoiser)
}

#[cfg(feature = "adapters")]
pub(super) fn adapter(text: &str) -> Result<&'static crate::sources::Adapter, String> {
    use crate::sources::ADAPTERS;
    let names = || ADAPTERS.iter().map(|adapter| adapter.name).collect::<Vec<_>>().join(", ");
    let found = ADAPTERS.iter().find(|adapter| adapter.name == text);
    found.ok_or_else(|| format!("the other renderers are: {}", names()))
}

#[cfg(feature = "adapters")]
impl DoctorArgs {
    pub fn check(self) -> crate::doctor::DoctorJob {
        crate::doctor::DoctorJob { install: self.install }
    }
}
