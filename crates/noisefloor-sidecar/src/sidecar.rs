//! A renderer in another process as a source.

use crate::error::{SidecarCause, SidecarError};
use crate::frame::MAX_HEADER;
use crate::process::{Failure, Process};
use crate::renderer::{Job, Renderer};
use crate::setup;
use noisefloor::{
    Batch, ProgressiveSource, Reference, Repeats, Request, Rgb, SourceError, SourceInfo, Unit, check_image,
};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Version of the protocol.
const PROTOCOL: u32 = 1;
/// Most tiles named in one call: their names stay below the longest header.
const CALL_TILES: usize = 4096;
/// Most pixels in one call: a reply of 3 GiB, where lengths have 32 bits. One image at most has as many.
const CALL_PIXELS: usize = noisefloor::MAX_PIXELS;
/// Bytes of a pixel on the wire.
const PIXEL: usize = 12;
/// Longest name that a renderer may give itself, in characters.
const NAME: usize = 200;

/// What an adapter adds to a [`Job`].
#[derive(Clone, Debug, Default)]
pub struct Adapter {
    /// The `options` of `init`, a JSON object; what is in it is between the adapter and its host script.
    pub options: serde_json::Map<String, serde_json::Value>,
    /// Environment variables of the process.
    pub env: Vec<(String, OsString)>,
    /// Notes for people, said before the renderer's own [`Sidecar::warnings`].
    pub warnings: Vec<String>,
}

/// A renderer in another process. Dropping it ends the process.
///
/// A call that fails because the process ended, did not answer in time, or sent what was not asked for, is repeated once in a
/// new process; all earlier batches stay valid. If it fails again, or if the renderer itself says that it cannot, the call is an
/// error, and the next call tries again.
#[derive(Debug)]
pub struct Sidecar {
    launch: Launch,
    process: Option<Process>,
    info: SourceInfo,
    warnings: Vec<String>,
    restarts: Vec<SidecarError>,
}

/// All that it takes to start the process, once more if need be.
#[derive(Debug)]
struct Launch {
    title: String,
    python: PathBuf,
    script: PathBuf,
    env: Vec<(String, OsString)>,
    init: Vec<u8>,
    loading: String,
    timeout: Duration,
}

#[derive(Serialize)]
struct Init<'a> {
    op: &'static str,
    protocol: u32,
    scene: &'a str,
    seed: u64,
    width: Option<usize>,
    height: Option<usize>,
    max_depth: Option<u32>,
    threads: Option<usize>,
    options: &'a serde_json::Map<String, serde_json::Value>,
}

#[derive(Serialize)]
struct Sample {
    op: &'static str,
    tiles: Vec<TileRequest>,
}

#[derive(Serialize)]
struct TileRequest {
    index: usize,
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    first: u64,
    samples: u32,
}

/// What every reply says.
#[derive(Deserialize)]
struct Status {
    ok: bool,
    error: Option<String>,
    tile: Option<usize>,
}

#[derive(Deserialize)]
struct Hello {
    name: String,
    width: usize,
    height: usize,
    unit: Unit,
    repeats: Repeats,
    #[serde(default)]
    warnings: Vec<String>,
}

#[derive(Deserialize)]
struct Sampled {
    samples: Vec<u32>,
}

#[derive(Deserialize)]
struct Referenced {
    reference: bool,
}

/// The tile to blame, where one is, and the cause.
type Blame = (Option<usize>, SidecarCause);

/// A reply whose header was read, and whose payload is not longer than it may be.
struct Reply<T> {
    header: T,
    payload: Vec<u8>,
}

impl Sidecar {
    /// Starts a renderer with an interpreter that has it ([`find`](crate::find)), and has it load the scene.
    ///
    /// # Errors
    /// [`SidecarError`] if there is no such scene, the process does not start, or the renderer cannot load it.
    pub fn open(
        renderer: &Renderer,
        python: &Path,
        job: &Job,
        adapter: Adapter,
    ) -> Result<Self, SidecarError> {
        let launch = Launch::new(renderer, python, job, &adapter)
            .map_err(|cause| SidecarError::at_the_start(renderer, cause))?;
        let (process, info, said) = launch.start()?;
        let warnings = adapter.warnings.into_iter().chain(said).collect();
        Ok(Self { launch, process: Some(process), info, warnings, restarts: Vec::new() })
    }

    /// The same with the interpreter that [`find`](crate::find) finds.
    ///
    /// # Errors
    /// [`SidecarError`] if there is none, too.
    pub fn start(renderer: &Renderer, job: &Job, adapter: Adapter) -> Result<Self, SidecarError> {
        let python =
            setup::find(renderer).map_err(|error| SidecarError::at_the_start(renderer, error.into()))?;
        Self::open(renderer, &python, job, adapter)
    }

    /// What the user should know: features of the scene that are ignored, a slower variant that had to do.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The failures that were mended by a new process, in order.
    pub fn restarts(&self) -> &[SidecarError] {
        &self.restarts
    }

    /// The number of its process, for whoever watches it; `None` between a failure and the next call.
    pub fn process_id(&self) -> Option<u32> {
        self.process.as_ref().map(Process::id)
    }

    /// Does one call, and once more in a new process where that may help.
    fn call<T: DeserializeOwned, R>(
        &mut self,
        doing: &str,
        tiles: &[Request],
        request: &impl Serialize,
        most_pixels: usize,
        read: impl Fn(Reply<T>) -> Result<R, Blame>,
    ) -> Result<R, SidecarError> {
        let first = match self.attempt(doing, tiles, request, most_pixels, &read) {
            Err(error) if error.cause.deserves_a_restart() => error,
            outcome => return outcome,
        };
        let second = self.attempt(doing, tiles, request, most_pixels, &read);
        if second.is_ok() {
            self.restarts.push(first);
        }
        second
    }

    fn attempt<T: DeserializeOwned, R>(
        &mut self,
        doing: &str,
        tiles: &[Request],
        request: &impl Serialize,
        most_pixels: usize,
        read: &impl Fn(Reply<T>) -> Result<R, Blame>,
    ) -> Result<R, SidecarError> {
        let mut process = match self.process.take() {
            Some(process) => process,
            None => self.restart()?,
        };
        let header = serde_json::to_vec(request).map_err(|e| (None, SidecarCause::Refused(e.to_string())));
        let outcome = header
            .and_then(|header| ask(&mut process, header, most_pixels, self.launch.timeout))
            .and_then(read);
        match outcome {
            Ok(result) => {
                self.process = Some(process);
                Ok(result)
            }
            Err((tile, cause)) => {
                let only = if let [one] = tiles { Some(one.tile.index) } else { None };
                let stays = !cause.deserves_a_restart();
                let error = SidecarError {
                    renderer: self.info.name.clone(),
                    doing: doing.to_owned(),
                    tile: tile.or(only),
                    cause: Box::new(cause),
                    last_words: process.last_words(),
                };
                if stays {
                    self.process = Some(process);
                }
                Err(error)
            }
        }
    }

    /// A new process that describes itself as the first one did.
    fn restart(&self) -> Result<Process, SidecarError> {
        let (mut process, info, _) = self.launch.start()?;
        if info == self.info {
            return Ok(process);
        }
        let what = format!("after a restart it is {info:?}, before it was {:?}", self.info);
        Err(self.launch.error(SidecarCause::Wrong { what }, process.last_words()))
    }

    fn sample_some(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SidecarError> {
        let tile = |r: &Request| {
            let noisefloor::Tile { index, x, y, width, height } = r.tile;
            TileRequest { index, x, y, width, height, first: r.first, samples: r.samples }
        };
        let request = Sample { op: "sample", tiles: requests.iter().map(tile).collect() };
        let doing = match requests {
            [one] => format!("sampling tile {}", one.tile.index),
            [first, .., last] => {
                format!("sampling {} tiles, {} to {}", requests.len(), first.tile.index, last.tile.index)
            }
            [] => return Ok(Vec::new()),
        };
        let pixels = requests.iter().map(|r| r.tile.pixels()).sum();
        self.call(&doing, requests, &request, pixels, |reply| batches(requests, reply))
    }

    fn failed(&self, error: SidecarError) -> SourceError {
        SourceError::Failed { name: self.info.name.clone(), tile: error.tile, cause: Box::new(error) }
    }
}

impl ProgressiveSource for Sidecar {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        // As few calls as headers and payloads may be long.
        let mut batches = Vec::with_capacity(requests.len());
        let mut rest = requests;
        while !rest.is_empty() {
            let mut pixels = 0;
            let fits = rest.iter().take(CALL_TILES).take_while(|r| {
                pixels += r.tile.pixels();
                pixels <= CALL_PIXELS
            });
            let (now, later) = rest.split_at(fits.count().max(1));
            batches.extend(self.sample_some(now).map_err(|error| self.failed(error))?);
            rest = later;
        }
        Ok(batches)
    }

    fn reference(&mut self) -> Result<Option<Reference>, SourceError> {
        let SourceInfo { width, height, .. } = self.info;
        let request = serde_json::json!({"op": "reference"});
        let read = |Reply { header: Referenced { reference }, payload }: Reply<Referenced>| {
            let pixels = if reference { width * height } else { 0 };
            exactly(&payload, pixels)?;
            Ok(reference.then(|| Reference { width, height, pixels: rgb(&payload).collect() }))
        };
        self.call("rendering the reference", &[], &request, width * height, read)
            .map_err(|error| self.failed(error))
    }
}

impl Launch {
    fn new(renderer: &Renderer, python: &Path, job: &Job, adapter: &Adapter) -> Result<Self, SidecarCause> {
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
            threads: job.threads.map(|n| n.get()),
            options: &adapter.options,
        };
        let init = serde_json::to_vec(&init).map_err(|e| scene(e.to_string()))?;
        if init.len() > MAX_HEADER {
            return Err(scene("its path and the options are longer than 1 MiB; shorten them".to_owned()));
        }
        Ok(Self {
            title: renderer.title.to_owned(),
            python: python.to_owned(),
            script: setup::host_script(renderer)?,
            env: adapter.env.clone(),
            init,
            loading: format!("loading {}", job.scene.display()),
            timeout: job.timeout,
        })
    }

    /// A process that has loaded the scene, what it is, and what it warns of.
    fn start(&self) -> Result<(Process, SourceInfo, Vec<String>), SidecarError> {
        let start = |source| SidecarCause::Start { python: self.python.clone(), source };
        let mut process = Process::start(&self.python, &self.script, &self.env)
            .map_err(|error| self.error(start(error), String::new()))?;
        let hello =
            ask(&mut process, self.init.clone(), 0, self.timeout).and_then(|reply| describe(reply.header));
        match hello {
            Ok((info, warnings)) => Ok((process, info, warnings)),
            Err((_, cause)) => Err(self.error(cause, process.last_words())),
        }
    }

    fn error(&self, cause: SidecarCause, last_words: String) -> SidecarError {
        let (renderer, doing) = (self.title.clone(), self.loading.clone());
        SidecarError { renderer, doing, tile: None, cause: Box::new(cause), last_words }
    }
}

/// A request and its reply, whose payload is at most so many pixels long.
fn ask<T: DeserializeOwned>(
    process: &mut Process,
    header: Vec<u8>,
    most_pixels: usize,
    timeout: Duration,
) -> Result<Reply<T>, Blame> {
    let wrong = |what: String| (None, SidecarCause::Wrong { what });
    let frame = process.call(header, most_pixels * PIXEL, timeout).map_err(|failure| match failure {
        Failure::Ended(status) => (None, SidecarCause::Died { status }),
        Failure::Silent => (None, SidecarCause::Silent { limit: timeout }),
        Failure::Garbled(error) => wrong(error.to_string()),
    })?;
    let status: Status = serde_json::from_slice(&frame.header).map_err(|e| wrong(e.to_string()))?;
    if !status.ok {
        let said = status.error.unwrap_or_else(|| "it cannot, and does not say why".to_owned());
        return Err((status.tile, SidecarCause::Refused(said)));
    }
    let header = serde_json::from_slice(&frame.header).map_err(|e| wrong(e.to_string()))?;
    Ok(Reply { header, payload: frame.payload })
}

fn describe(hello: Hello) -> Result<(SourceInfo, Vec<String>), Blame> {
    let Hello { name, width, height, unit, repeats, warnings } = hello;
    let wrong = |what: String| (None, SidecarCause::Wrong { what });
    check_image(width, height).map_err(|e| wrong(e.to_string()))?;
    let name: String = name.chars().filter(|c| !c.is_control()).take(NAME).collect();
    if name.trim().is_empty() {
        return Err(wrong("it has no name".to_owned()));
    }
    Ok((SourceInfo { name, width, height, unit, aims: true, repeats }, warnings))
}

fn batches(
    requests: &[Request],
    Reply { header: Sampled { samples }, payload }: Reply<Sampled>,
) -> Result<Vec<Batch>, Blame> {
    if samples.len() != requests.len() {
        let what = format!("{} numbers of samples for {} tiles", samples.len(), requests.len());
        return Err((None, SidecarCause::Wrong { what }));
    }
    let given = || requests.iter().zip(samples.iter().copied());
    exactly(&payload, given().map(|(r, n)| if n > 0 { r.tile.pixels() } else { 0 }).sum())?;
    let mut pixels = rgb(&payload);
    given()
        .map(|(Request { tile, .. }, samples)| {
            let mean: Vec<Rgb> = pixels.by_ref().take(if samples > 0 { tile.pixels() } else { 0 }).collect();
            if samples > 0 && !mean.iter().flatten().any(|c| c.is_finite()) {
                return Err((Some(tile.index), SidecarCause::NotFinite));
            }
            Ok(Batch { tile: *tile, samples, mean })
        })
        .collect()
}

fn exactly(payload: &[u8], pixels: usize) -> Result<(), Blame> {
    if payload.len() == pixels * PIXEL {
        return Ok(());
    }
    let what = format!("a payload of {} bytes where {} are right", payload.len(), pixels * PIXEL);
    Err((None, SidecarCause::Wrong { what }))
}

fn rgb(payload: &[u8]) -> impl Iterator<Item = Rgb> {
    let value = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().unwrap_or_default());
    payload.chunks_exact(PIXEL).map(move |p| [value(&p[..4]), value(&p[4..8]), value(&p[8..])])
}
