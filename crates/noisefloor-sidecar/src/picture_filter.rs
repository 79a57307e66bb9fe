//! A process that turns pictures into a picture, such as a denoiser.

use crate::call::{Blame, Reply, ask, exactly, rgb};
use crate::error::{SidecarCause, SidecarError};
use crate::message::{FilterHello, Filtered, Filtering, InitFilter, PROTOCOL};
use crate::process::Process;
use crate::renderer::{DEFAULT_TIMEOUT, Device, Renderer};
use crate::setup;
use noisefloor::{Rgb, text::printable, tile::MAX_PIXELS};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Most bytes of a request: lengths have 32 bits.
const MOST: usize = u32::MAX as usize;

/// How a filter is run.
#[derive(Clone, Debug)]
pub struct FilterPlan {
    /// Number of threads; the filter's choice if `None`.
    pub threads: Option<NonZeroUsize>,
    /// What computes; the processor if `None`.
    pub device: Option<Device>,
    /// Time limit for one call, including the one that loads the filter.
    pub timeout: Duration,
}

impl Default for FilterPlan {
    fn default() -> Self {
        Self { threads: None, device: None, timeout: DEFAULT_TIMEOUT }
    }
}

/// A filter in another process. Dropping it ends the process.
///
/// A call that fails because the process ended, did not answer in time, or sent something else than a picture
/// is repeated once in a new process.
#[derive(Debug)]
pub struct PictureFilter {
    title: &'static str,
    python: PathBuf,
    script: PathBuf,
    init: Vec<u8>,
    timeout: Duration,
    process: Option<Process>,
    name: String,
    warnings: Vec<String>,
    /// It has said its name and warnings.
    described: bool,
    give_up: Option<Arc<AtomicBool>>,
}

impl PictureFilter {
    /// Starts a filter. `python` is an interpreter that has it, see [`find`](crate::find).
    ///
    /// # Errors
    /// [`SidecarError`] if the process does not start, or the filter does not load.
    pub fn open(filter: &Renderer, python: &Path, plan: FilterPlan) -> Result<Self, SidecarError> {
        let threads = plan.threads.map(NonZeroUsize::get);
        let device = plan.device.as_ref().map(Device::as_str);
        let init = InitFilter { op: "init", protocol: PROTOCOL, threads, device };
        let fail = |cause| SidecarError::at_the_start(filter, cause);
        let init = serde_json::to_vec(&init).map_err(|e| fail(SidecarCause::Refused(e.to_string())))?;
        let script = setup::host_script(filter).map_err(|error| fail(error.into()))?;
        let (title, name, timeout) = (filter.title, filter.title.to_owned(), plan.timeout);
        let (python, process, give_up) = (python.to_owned(), None, None);
        let (warnings, described) = (Vec::new(), false);
        let mut this =
            Self { title, python, script, init, timeout, process, name, warnings, described, give_up };
        this.process = Some(this.start()?);
        Ok(this)
    }

    /// Gives a call up as soon as the flag is set, as [`SidecarCause::GivenUp`]: one that hangs must not hold
    /// what is to be saved.
    pub fn give_up_when(&mut self, flag: Arc<AtomicBool>) {
        if let Some(process) = &mut self.process {
            process.give_up_when(Some(Arc::clone(&flag)));
        }
        self.give_up = Some(flag);
    }

    /// Its name and version, as it says.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What the user should know, such as why it does without a GPU.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// What the filter makes of each frame, of named pictures of `width`×`height` pixels: a picture of the same
    /// size, as if the frame were alone. All frames have pictures of the same names.
    ///
    /// # Errors
    /// [`SidecarError`] if the pictures are too large, have another size or other names, the process fails twice,
    /// the filter refuses, or the result is not finite.
    pub fn apply<const N: usize>(
        &mut self,
        (width, height): (usize, usize),
        frames: [&[(&str, &[Rgb])]; N],
    ) -> Result<[Vec<Rgb>; N], SidecarError> {
        let pixels = width.saturating_mul(height);
        let pictures: usize = frames.iter().map(|pictures| pictures.len()).sum();
        if pixels == 0 || pixels > MAX_PIXELS || pixels.saturating_mul(12 * pictures.max(N)) > MOST {
            let what = format!("{pictures} pictures of {width}×{height} pixels do not fit into a call");
            return Err(self.error(SidecarCause::Refused(what), String::new()));
        }
        if let Some((name, picture)) = frames.concat().iter().find(|(_, picture)| picture.len() != pixels) {
            let what = format!("its picture {name} has {} pixels, not {width}×{height}", picture.len());
            return Err(self.error(SidecarCause::Refused(what), String::new()));
        }
        let names = |frame: &[(&str, &[Rgb])]| frame.iter().map(|(name, _)| (*name).to_owned()).collect();
        let names: [Vec<String>; N] = frames.map(names);
        if names.iter().any(|of_frame| *of_frame != names[0]) {
            let what = format!("its frames have pictures of different names: {names:?}");
            return Err(self.error(SidecarCause::Refused(what), String::new()));
        }
        match self.attempt((width, height), frames) {
            Err(error) if error.cause.deserves_a_restart() => self.attempt((width, height), frames),
            outcome => outcome,
        }
    }

    fn attempt<const N: usize>(
        &mut self,
        (width, height): (usize, usize),
        frames: [&[(&str, &[Rgb])]; N],
    ) -> Result<[Vec<Rgb>; N], SidecarError> {
        let mut process = match self.process.take() {
            Some(process) => process,
            None => self.start()?,
        };
        let names: Vec<&str> = frames.iter().take(1).flat_map(|f| f.iter().map(|(name, _)| *name)).collect();
        let request = Filtering { op: "filter", width, height, frames: N, pictures: &names };
        let values =
            frames.iter().flat_map(|frame| frame.iter().flat_map(|(_, picture)| picture.as_flattened()));
        let payload: Vec<u8> = values.flat_map(|value| value.to_le_bytes()).collect();
        let outcome = serde_json::to_vec(&request)
            .map_err(|e| (None, SidecarCause::Refused(e.to_string())))
            .and_then(|header| ask(&mut process, header, payload, N * width * height, self.timeout))
            .and_then(|reply| read(reply, width * height));
        let stays = outcome.as_ref().err().is_none_or(|(_, cause)| !cause.deserves_a_restart());
        let outcome = outcome.map_err(|(_, cause)| self.error(cause, process.last_words()));
        if stays {
            self.process = Some(process);
        }
        outcome
    }

    fn start(&mut self) -> Result<Process, SidecarError> {
        let start = |source| SidecarCause::Start { python: self.python.clone(), source };
        let mut process = Process::start(&self.python, &self.script, &[])
            .map_err(|error| self.error(start(error), String::new()))?;
        process.give_up_when(self.give_up.clone());
        let hello = ask::<FilterHello>(&mut process, self.init.clone(), Vec::new(), 0, self.timeout);
        match hello {
            Ok(hello) => {
                let name = printable(&hello.header.name).into_owned();
                // What another device computes has other bits
                if std::mem::replace(&mut self.described, true) && name != self.name {
                    let what = format!("after a restart it is {name}, before it was {}", self.name);
                    return Err(self.error(SidecarCause::Wrong { what }, process.last_words()));
                }
                self.name = name;
                self.warnings =
                    hello.header.warnings.iter().map(|warning| printable(warning).into_owned()).collect();
                Ok(process)
            }
            Err((_, cause)) => Err(self.error(cause, process.last_words())),
        }
    }

    fn error(&self, cause: SidecarCause, last_words: String) -> SidecarError {
        let (renderer, doing) = (self.title.to_owned(), "filtering a picture".to_owned());
        SidecarError { renderer, doing, tile: None, cause: Box::new(cause), last_words }
    }
}

/// The pictures of a reply.
fn read<const N: usize>(
    Reply { payload, .. }: Reply<Filtered>,
    pixels: usize,
) -> Result<[Vec<Rgb>; N], Blame> {
    exactly(&payload, N * pixels)?;
    let values: Vec<Rgb> = rgb(&payload).collect();
    if values.as_flattened().iter().all(|value| value.is_finite()) {
        return Ok(std::array::from_fn(|frame| values[frame * pixels..][..pixels].to_vec()));
    }
    Err((None, SidecarCause::Refused("its picture is not finite".to_owned())))
}
