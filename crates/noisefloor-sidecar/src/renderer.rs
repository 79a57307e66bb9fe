//! What an adapter declares about its renderer, and what a caller asks of it.

use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

/// Default time limit for one call: half an hour. Renderers are slow; processes that hang are rare.
pub const DEFAULT_TIMEOUT: Duration = Duration::from_secs(1800);

/// A renderer, as its adapter crate declares it in a constant.
#[derive(Clone, Copy, Debug)]
pub struct Renderer {
    /// Short name for files and options, lower-case ASCII letters: `"mitsuba"`.
    pub name: &'static str,
    /// Display name with the installed version: `"Mitsuba 3.9.1"`.
    pub title: &'static str,
    /// The host script (see `host/host.py`); its file is called `NAME_host.py`.
    pub script: &'static str,
    /// Pinned packages with hashes, as `pip install --require-hashes` takes them.
    pub requirements: &'static str,
    /// Minor versions of CPython 3 that those packages support, best first: `&[12, 11]`.
    pub pythons: &'static [u8],
    /// Python statements that load the renderer and print its version.
    pub probe: &'static str,
}

impl Renderer {
    /// The environment variable for an interpreter to use instead of the private one:
    /// `NOISEFLOOR_MITSUBA_PYTHON`.
    pub fn variable(&self) -> String {
        format!("NOISEFLOOR_{}_PYTHON", self.name.to_ascii_uppercase())
    }
}

/// What computes, where a renderer or a denoiser has the choice.
///
/// ```
/// use noisefloor_sidecar::Device;
///
/// assert_eq!("gpu".parse(), Ok(Device::GPU));
/// assert_eq!("H200".parse::<Device>()?.to_string(), "H200");
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub struct Device(Cow<'static, str>);

impl Device {
    /// A GPU that works, if there is one; the host says why not, if there is none.
    pub const AUTO: Self = Self(Cow::Borrowed("auto"));
    /// The processor.
    pub const CPU: Self = Self(Cow::Borrowed("cpu"));
    /// A GPU, or an error.
    pub const GPU: Self = Self(Cow::Borrowed("gpu"));

    /// As it was written.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for Device {
    type Err = String;

    /// `auto`, `cpu`, `gpu`, the number of a GPU as `noisefloor doctor` lists them, or a part of its name or kind.
    fn from_str(text: &str) -> Result<Self, String> {
        if text.trim().is_empty() || text.len() > 200 || text.chars().any(char::is_control) {
            return Err(
                "a device is `auto`, `cpu`, `gpu`, the number of a GPU, or a part of its name".to_owned()
            );
        }
        let known = [Self::AUTO, Self::CPU, Self::GPU].into_iter().find(|known| known.0 == text);
        Ok(known.unwrap_or_else(|| Self(Cow::Owned(text.trim().to_owned()))))
    }
}

impl TryFrom<String> for Device {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// What to render and how, for any renderer. Made by [`Job::new`]; all fields can then be changed.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Job {
    /// The scene, in a format of the renderer. Its path must be Unicode.
    pub scene: PathBuf,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Width and height in pixels; the scene's own if `None`.
    pub size: Option<(usize, usize)>,
    /// Longest path, in segments: 1 is directly visible light, 2 is direct lighting; the scene's own if
    /// `None`.
    pub max_depth: Option<u32>,
    /// The frame of a scene that holds several; the scene's own if `None`. Renderers whose scenes hold one ignore it.
    pub frame: Option<i32>,
    /// Number of threads; the renderer's choice if `None`.
    pub threads: Option<NonZeroUsize>,
    /// What renders; if `None`, what the scene says, or else the processor.
    pub device: Option<Device>,
    /// Time limit for one call, including the one that loads the scene.
    pub timeout: Duration,
}

impl Job {
    /// A scene with its own size and depth, seed 1 and [`DEFAULT_TIMEOUT`].
    pub fn new(scene: impl Into<PathBuf>) -> Self {
        let scene = scene.into();
        Self {
            scene,
            seed: 1,
            size: None,
            max_depth: None,
            frame: None,
            threads: None,
            device: None,
            timeout: DEFAULT_TIMEOUT,
        }
    }
}

/// What an adapter adds to a [`Job`].
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct HostOptions {
    /// The `options` of the `init` request; their meaning is between the adapter and its host script.
    pub options: BTreeMap<String, String>,
    /// Environment variables of the process.
    pub env: Vec<(String, OsString)>,
    /// Warnings of the adapter, which precede the renderer's own in
    /// [`Sidecar::warnings`](crate::Sidecar::warnings).
    pub warnings: Vec<String>,
}
