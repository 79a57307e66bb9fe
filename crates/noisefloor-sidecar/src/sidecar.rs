//! A renderer in another process as a source.

use crate::call::{Blame, Described, Reply, ask, batches, exactly, rgb};
use crate::error::{SidecarCause, SidecarError};
use crate::launch::Launch;
use crate::message::{Adapted, Adaptive, FirstHitsMade, HitFirst, Sample, TileRequest};
use crate::process::Process;
use crate::renderer::{HostOptions, Job, Renderer};
use crate::setup;
use noisefloor::{
    Batch, ProgressiveSource, Request, Rgb, SourceError, SourceInfo, Tile,
    source::{FirstHits, SourceIdentity},
    tune::PixelCounts,
    watch::LightCheck,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Most tiles named in one call: their names stay below the longest header.
const CALL_TILES: usize = 4096;
/// Most pixels in one call: a reply of 3 GiB, where lengths have 32 bits. An image has no more.
const CALL_PIXELS: usize = noisefloor::tile::MAX_PIXELS;

/// A picture as a renderer itself has sampled it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct AdaptivePicture {
    /// Linear radiance, row-major.
    pub pixels: Vec<Rgb>,
    /// The samples of its pixels, if the renderer tells.
    pub counts: Option<PixelCounts>,
}

/// The samples of pixels that a renderer tells, with their limits, if they can be such.
fn pixel_counts(limits: [f32; 3], payload: &[u8]) -> Result<PixelCounts, Blame> {
    let samples: Vec<f32> = rgb(payload).map(|[samples, ..]| samples).collect();
    PixelCounts::new(samples, limits).ok_or_else(|| {
        let what = format!("sample counts that cannot be, with the limits {limits:?}");
        (None, SidecarCause::Wrong { what })
    })
}

/// A renderer in another process. Dropping it ends the process.
///
/// A call that fails because the process ended, did not answer in time, or sent something else than requested
/// is repeated once in a new process; all earlier batches stay valid. If it fails again, or if the renderer
/// itself refuses, the call is an error, and the next call tries again. Batches of impossible light
/// ([`ImpossibleLight`](noisefloor::watch::ImpossibleLight)) are errors, too.
#[derive(Debug)]
pub struct Sidecar {
    launch: Launch,
    process: Option<Process>,
    info: SourceInfo,
    /// Samples that it takes before it can stop, over all pixels of a tile.
    late: u64,
    /// The scene as it was when the process loaded it.
    identity: SourceIdentity,
    warnings: Vec<String>,
    restarts: Vec<SidecarError>,
    light: LightCheck,
}

impl Sidecar {
    /// Starts a renderer and loads the scene. `python` is an interpreter that has the renderer, see
    /// [`find`](crate::find).
    ///
    /// # Errors
    /// [`SidecarError`] if the scene does not exist, the process does not start, or the renderer cannot load
    /// the scene.
    pub fn open(
        renderer: &Renderer,
        python: &Path,
        job: &Job,
        options: HostOptions,
    ) -> Result<Self, SidecarError> {
        let launch = Launch::new(renderer, python, job, &options)
            .map_err(|cause| SidecarError::at_the_start(renderer, cause))?;
        // Before the scene is loaded: an edit in between is then noticed, if not now
        let identity = launch.contents()?;
        let (process, Described { info, late, warnings: said }) = launch.start()?;
        let identity = identity.with_options(&info.name);
        let warnings = options.warnings.into_iter().chain(said).collect();
        let (process, restarts, light) = (Some(process), Vec::new(), LightCheck::default());
        Ok(Self { launch, process, info, late, identity, warnings, restarts, light })
    }

    /// As [`Sidecar::open`], with the interpreter that [`find`](crate::find) returns.
    ///
    /// # Errors
    /// As [`Sidecar::open`], and if there is no interpreter.
    pub fn start(renderer: &Renderer, job: &Job, options: HostOptions) -> Result<Self, SidecarError> {
        let python =
            setup::find(renderer).map_err(|error| SidecarError::at_the_start(renderer, error.into()))?;
        Self::open(renderer, &python, job, options)
    }

    /// What the user should know, for example features of the scene that are ignored, or that a slower
    /// variant is used.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The failures that a new process overcame, in order.
    pub fn restarts(&self) -> &[SidecarError] {
        &self.restarts
    }

    /// Its process id, for monitoring; `None` between a failure and the next call.
    pub fn process_id(&self) -> Option<u32> {
        self.process.as_ref().map(Process::id)
    }

    /// A picture as the renderer itself samples it, by its own settings, until its own noise threshold; `None` if this
    /// renderer has no such threshold. A `part` of it is as in the whole, or refused. `samples` is the most per pixel; without
    /// it, what the scene says. Pictures of two seeds below 2³¹ are independent.
    ///
    /// # Errors
    /// [`SidecarError`] as for samples.
    pub fn adaptive(
        &mut self,
        threshold: f64,
        samples: Option<u64>,
        seed: u32,
        part: Option<Tile>,
    ) -> Result<Option<AdaptivePicture>, SidecarError> {
        let pixels = part.map_or(self.info.width * self.info.height, |part| part.pixels());
        let part = part.map(|part| [part.x, part.y, part.width, part.height]);
        let request = Adaptive { op: "adaptive", threshold, samples, seed, part };
        let read = |Reply { header: Adapted { adaptive, counts }, payload }: Reply<Adapted>| {
            let pictures = match (adaptive, counts) {
                (false, _) => 0,
                (true, None) => 1,
                (true, Some(_)) => 2,
            };
            exactly(&payload, pictures * pixels)?;
            let (picture, samples) = payload.split_at(payload.len() / pictures.max(1));
            let counts = counts.map(|limits| pixel_counts(limits, samples)).transpose()?;
            Ok(adaptive.then(|| AdaptivePicture { pixels: rgb(picture).collect(), counts }))
        };
        let doing = format!("rendering until a noise threshold of {threshold}");
        self.call(&doing, &[], &request, 2 * pixels, read)
    }

    /// One call, repeated in a new process if that may help.
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
            .and_then(|header| ask(&mut process, header, Vec::new(), most_pixels, self.launch.timeout))
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

    /// A new process that describes itself exactly as the first one did, and has loaded the same scene.
    fn restart(&self) -> Result<Process, SidecarError> {
        let contents = self.launch.contents()?.with_options(&self.info.name);
        if let Some(change) = contents.change_since(&self.identity) {
            let what = format!("after a restart it would render another scene: {change}");
            return Err(self.launch.error(SidecarCause::Refused(what), String::new()));
        }
        let (mut process, Described { info, .. }) = self.launch.start()?;
        if info == self.info {
            return Ok(process);
        }
        let what = format!("after a restart it is {info:?}, before it was {:?}", self.info);
        Err(self.launch.error(SidecarCause::Wrong { what }, process.last_words()))
    }

    fn sample_some(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SidecarError> {
        let tile = |r: &Request| {
            let noisefloor::Tile { index, x, y, width, height } = r.tile;
            let (sequence, point) = (r.sequence.number, r.sequence.first);
            TileRequest { index, x, y, width, height, first: r.first, samples: r.spp, sequence, point }
        };
        let request = Sample { op: "sample", tiles: requests.iter().map(tile).collect() };
        let doing = match requests {
            [one] => format!("sampling tile {}", one.tile.index),
            [first, .., last] => {
                format!("sampling {} tiles, {} to {}", requests.len(), first.tile.index, last.tile.index)
            }
            [] => return Ok(Vec::new()),
        };
        let (pixels, late) = (requests.iter().map(|r| r.tile.pixels()).sum(), self.late);
        let batches =
            self.call(&doing, requests, &request, pixels, |reply| batches(requests, late, reply))?;
        for batch in &batches {
            if let Err(cause) = self.light.check(&batch.mean) {
                return Err(SidecarError {
                    renderer: self.info.name.clone(),
                    doing,
                    tile: Some(batch.tile.index),
                    cause: Box::new(cause.into()),
                    last_words: self.process.as_mut().map(Process::last_words).unwrap_or_default(),
                });
            }
        }
        Ok(batches)
    }

    fn failed(&self, error: SidecarError) -> SourceError {
        SourceError::Failed { name: self.info.name.clone(), tile: error.tile, cause: Box::new(error) }
    }
}

impl ProgressiveSource for Sidecar {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    /// The scene file, and what can be known of the files that it reads. Never fails.
    fn identity(&self) -> Result<SourceIdentity, SourceError> {
        Ok(self.identity.clone())
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        // As few calls as the limits on headers and payloads allow
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

    /// Albedo is cut to [0, 1], and what is not finite becomes 0.
    fn first_hits(&mut self, index: u64, spp: u64) -> Result<Option<FirstHits>, SourceError> {
        let SourceInfo { width, height, .. } = self.info;
        let request = HitFirst { op: "first_hits", index, samples: spp };
        let read = |Reply { header: FirstHitsMade { first_hits }, payload }: Reply<FirstHitsMade>| {
            exactly(&payload, if first_hits { 2 * width * height } else { 0 })?;
            let (albedo, normal) = payload.split_at(payload.len() / 2);
            let within = |payload, low| -> Vec<Rgb> {
                let cut = |c: f32| if c.is_finite() { c.clamp(low, 1.0) } else { 0.0 };
                rgb(payload).map(|pixel| pixel.map(cut)).collect()
            };
            let (albedo, normal) = (within(albedo, 0.0), within(normal, -1.0));
            Ok(first_hits.then_some(FirstHits::new((width, height), albedo, normal)))
        };
        self.call("rendering first hits", &[], &request, 2 * width * height, read)
            .map_err(|error| self.failed(error))
    }
}
