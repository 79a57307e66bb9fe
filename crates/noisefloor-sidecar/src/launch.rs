//! Starting a renderer's process.

use crate::call::{Described, ask, describe};
use crate::contents::contents;
use crate::error::{SidecarCause, SidecarError};
use crate::frame::MAX_HEADER;
use crate::message::{Init, PROTOCOL};
use crate::process::Process;
use crate::renderer::{Device, HostOptions, Job, Renderer};
use crate::setup;
use noisefloor::source::SourceIdentity;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// All that it takes to start the process, again if necessary.
#[derive(Debug)]
pub(crate) struct Launch {
    title: String,
    python: PathBuf,
    script: PathBuf,
    env: Vec<(String, OsString)>,
    init: Vec<u8>,
    scene: PathBuf,
    /// What the samples depend on beside the scene.
    options: String,
    loading: String,
    pub(crate) timeout: Duration,
}

impl Launch {
    pub(crate) fn new(
        renderer: &Renderer,
        python: &Path,
        job: &Job,
        options: &HostOptions,
    ) -> Result<Self, SidecarCause> {
        let scene = |why: String| SidecarCause::Scene { path: job.scene.clone(), why };
        let path = std::path::absolute(&job.scene).map_err(|e| scene(e.to_string()))?;
        if let Err(error) = std::fs::metadata(&path) {
            return Err(scene(format!("cannot be read: {error}; check the path")));
        }
        let text = path.to_str().ok_or_else(|| scene("its name is not Unicode; rename it".to_owned()))?;
        let init = Init {
            op: "init",
            protocol: PROTOCOL,
            scene: text,
            seed: job.seed,
            width: job.size.map(|(width, _)| width),
            height: job.size.map(|(_, height)| height),
            max_depth: job.max_depth,
            frame: job.frame,
            threads: job.threads.map(|n| n.get()),
            device: job.device.as_ref().map(Device::as_str),
            options: &options.options,
        };
        let init = serde_json::to_vec(&init).map_err(|e| scene(e.to_string()))?;
        if init.len() > MAX_HEADER {
            return Err(scene("its path and the options exceed 1 MiB; shorten them".to_owned()));
        }
        Ok(Self {
            title: renderer.title.to_owned(),
            python: python.to_owned(),
            script: setup::host_script(renderer)?,
            env: options.env.clone(),
            init,
            options: identity(renderer, job, options),
            scene: path,
            loading: format!("loading {}", job.scene.display()),
            timeout: job.timeout,
        })
    }

    /// Digests of the scene and of what it is known to read.
    pub(crate) fn contents(&self) -> Result<SourceIdentity, SidecarError> {
        contents(&self.scene, self.options.clone()).map_err(|error| {
            let why = format!("it, or a file that it names, cannot be read: {error}");
            self.error(SidecarCause::Scene { path: self.scene.clone(), why }, String::new())
        })
    }

    /// A process that has loaded the scene, and its description.
    pub(crate) fn start(&self) -> Result<(Process, Described), SidecarError> {
        let start = |source| SidecarCause::Start { python: self.python.clone(), source };
        let mut process = Process::start(&self.python, &self.script, &self.env)
            .map_err(|error| self.error(start(error), String::new()))?;
        let hello = ask(&mut process, self.init.clone(), Vec::new(), 0, self.timeout)
            .and_then(|reply| describe(reply.header));
        match hello {
            Ok(described) => Ok((process, described)),
            Err((_, cause)) => Err(self.error(cause, process.last_words())),
        }
    }

    pub(crate) fn error(&self, cause: SidecarCause, last_words: String) -> SidecarError {
        let (renderer, doing) = (self.title.clone(), self.loading.clone());
        SidecarError { renderer, doing, tile: None, cause: Box::new(cause), last_words }
    }
}

/// What the samples depend on beside the scene; threads are not part of it.
fn identity(renderer: &Renderer, job: &Job, options: &HostOptions) -> String {
    let (title, Job { seed, max_depth, .. }) = (renderer.title, job);
    format!("{title}, seed {seed}, max_depth {max_depth:?}, {:?}", options.options)
}
