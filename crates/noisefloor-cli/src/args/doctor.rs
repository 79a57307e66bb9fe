//! `noisefloor doctor`.

use clap::Args;

/// List the other renderers, say what each one lacks here, or install one.
///
/// A renderer runs in the Python that NOISEFLOOR_NAME_PYTHON names (such as NOISEFLOOR_MITSUBA_PYTHON),
/// otherwise in a private environment in the cache folder, which --install makes with pinned packages. The
/// exit code is 1 if a renderer is installed but does not load; one that is not installed is no error.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor doctor
  noisefloor doctor --install mitsuba                 or luxcore, or cycles")]
pub struct DoctorArgs {
    /// Install this renderer, if it is not there yet.
    #[arg(long, value_name = "RENDERER")]
    #[cfg_attr(feature = "adapters", arg(value_parser = adapter))]
    install: Option<Renderer>,
}

#[cfg(feature = "adapters")]
type Renderer = &'static crate::sources::Adapter;
#[cfg(not(feature = "adapters"))]
type Renderer = String;

#[cfg(feature = "adapters")]
pub(super) fn adapter(text: &str) -> Result<Renderer, String> {
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
