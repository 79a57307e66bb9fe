//! The renderer as a source of samples.

use crate::camera::Lens;
use crate::error::{OutsideError, RenderError};
use crate::filter::Filter;
use crate::first_hits;
use crate::integrator::{Estimator, SampleRadiance, Settings, integrator};
use crate::math::Vec3;
use crate::reference::{self, ReferenceNoise, Watch};
use crate::rng::Key;
use crate::sampler::{Place, Sampler, Sampling};
use crate::scene::Scene;
use noisefloor::{
    Batch, ProgressiveSource, Repeats, Request, Rgb, SourceError, SourceInfo, Tile, ToneMapping,
    display::Display,
    source::{FirstHits, Reference, SourceIdentity},
};
use rayon::prelude::*;
use serde::Serialize;
use std::fmt;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Longest path that can be requested, in segments.
pub const MAX_DEPTH: u32 = 10_000;
/// Largest number of threads that can be requested.
pub const MAX_THREADS: usize = 1024;

/// Largest edge of the small picture that the exposure of a reference is taken from.
const PREVIEW: usize = 64;

/// How to render. Build it with [`RenderOptions::default`] and `..`, since fields may be added.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RenderOptions {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Longest path in segments, 1…[`MAX_DEPTH`]: 1 is emitted light seen directly, 2 is direct light.
    pub max_depth: u32,
    /// Number of segments from which Russian roulette may end paths, at least 1.
    pub roulette: u32,
    /// How paths find light.
    pub estimator: Estimator,
    /// How the samples of a pixel are distributed.
    pub sampling: Sampling,
    /// Reconstruction filter of the pixels.
    pub filter: Filter,
    /// Largest channel of a sample, above 0. Brighter samples are scaled down to it and counted, which loses
    /// light. `None`, the default, keeps all light.
    pub clamp: Option<f32>,
    /// Number of threads of the renderer's own pool, at most [`MAX_THREADS`]; `None`: the caller's rayon
    /// pool. Pictures do not depend on it.
    pub threads: Option<NonZeroUsize>,
}

impl Default for RenderOptions {
    /// Seed 0, paths of up to 65 segments, Russian roulette from the fifth, multiple importance sampling,
    /// Sobol points, a box filter, no clamping, the caller's threads.
    fn default() -> Self {
        Self {
            seed: 0,
            max_depth: 65,
            roulette: 5,
            estimator: Estimator::Mis,
            sampling: Sampling::default(),
            filter: Filter::Box,
            clamp: None,
            threads: None,
        }
    }
}

/// The path tracer: renders a scene at a resolution, by path tracing with next event estimation.
///
/// All random numbers follow from (seed, pixel, sample index), and the mean of a batch is summed in `f64`.
/// Pictures are therefore identical to the bit for any number of threads, and means are identical up to the
/// rounding of `f32` however requests are divided. With every filter, a sample counts for one pixel only, so
/// that noise is independent from pixel to pixel.
pub struct Ptwne {
    pub(crate) scene: Arc<Scene>,
    pub(crate) width: usize,
    pub(crate) height: usize,
    options: RenderOptions,
    sample_radiance: SampleRadiance,
    pool: Option<rayon::ThreadPool>,
    tally: Tally,
    watch: Box<Watch>,
    reference_noise: Option<ReferenceNoise>,
    program: Option<String>,
}

/// Counts of the samples taken so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SampleCounts {
    pub samples: u64,
    /// Those that were negative or not finite, and were replaced by black.
    pub dropped: u64,
    /// Those that were scaled down to [`RenderOptions::clamp`].
    pub clamped: u64,
    /// Those in tiles that see only the background, for which no ray was traced.
    pub background: u64,
}

#[derive(Debug, Default)]
struct Tally {
    samples: AtomicU64,
    dropped: AtomicU64,
    clamped: AtomicU64,
    background: AtomicU64,
}

impl Ptwne {
    /// A renderer of `scene` at `width`×`height` pixels.
    ///
    /// # Errors
    /// [`RenderError`] if the size or an option is out of range, or threads could not be started.
    pub fn new(
        scene: impl Into<Arc<Scene>>,
        width: usize,
        height: usize,
        options: RenderOptions,
    ) -> Result<Self, RenderError> {
        noisefloor::tile::check_image(width, height)?;
        let bad = |name, value, range| Err(RenderError::Option { name, value, range });
        if !(1..=MAX_DEPTH).contains(&options.max_depth) {
            return bad("max_depth", options.max_depth as usize, "1…10000 segments");
        }
        if options.roulette == 0 {
            return bad("roulette", 0, "at least 1 segment");
        }
        if let Some(clamp) = options.clamp.filter(|c| !(*c > 0.0 && c.is_finite())) {
            return Err(RenderError::Clamp(clamp));
        }
        let pool = match options.threads.map(NonZeroUsize::get) {
            Some(threads) if threads > MAX_THREADS => return bad("threads", threads, "1…1024"),
            Some(threads) => Some(
                rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build()
                    .map_err(|e| RenderError::Threads(Box::new(e)))?,
            ),
            None => None,
        };
        let scene = scene.into();
        let sample_radiance = integrator(scene.has_opacity);
        Ok(Self {
            scene,
            width,
            height,
            options,
            sample_radiance,
            pool,
            tally: Tally::default(),
            watch: Box::new(|_, _| ControlFlow::Continue(())),
            reference_noise: None,
            program: None,
        })
    }

    /// Names the build of the program that this renderer is part of, such as a digest of its file. It becomes
    /// part of [`identity`](ProgressiveSource::identity): another build may take other samples, and is then
    /// not to resume what this one has begun.
    #[must_use]
    pub fn with_program(mut self, build: impl Into<String>) -> Self {
        self.program = Some(build.into());
        self
    }

    /// Renders with opacity tests even if the scene has no partly transparent surfaces. Pictures are the
    /// same; it is for measuring what leaving the tests out saves.
    pub fn force_opacity_tests(&mut self) {
        self.sample_radiance = integrator(true);
    }

    /// Renders the paper's reference (§4.3): direct light, mirrors and glass, without visible noise. It follows from the seed, and
    /// changes no sample.
    pub fn reference(&mut self) -> Result<Reference, SourceError> {
        let key = Key::new(self.options.seed);
        let display = self.preview()?;
        let size = [self.width, self.height];
        let picture =
            self.on_threads(|| reference::render(&self.scene, size, key, &display, self.watch.as_ref()));
        let picture = picture.ok_or_else(|| self.fail(None, RenderError::Cancelled))?;
        self.reference_noise = Some(picture.noise);
        Ok(Reference::new((self.width, self.height), picture.pixels))
    }

    /// Counts of the samples taken so far.
    pub fn counts(&self) -> SampleCounts {
        let read = |a: &AtomicU64| a.load(Ordering::Relaxed);
        let Tally { samples, dropped, clamped, background } = &self.tally;
        SampleCounts {
            samples: read(samples),
            dropped: read(dropped),
            clamped: read(clamped),
            background: read(background),
        }
    }

    /// Has `watch` called while a reference is rendered, with the number of finished blocks and that of all
    /// blocks. [`ControlFlow::Break`] cancels the reference. Calls come from any thread.
    pub fn watch_reference(
        &mut self,
        watch: impl Fn(usize, usize) -> ControlFlow<()> + Send + Sync + 'static,
    ) {
        self.watch = Box::new(watch);
    }

    /// The noise of the last reference; `None` before the first one.
    pub fn reference_noise(&self) -> Option<&ReferenceNoise> {
        self.reference_noise.as_ref()
    }

    pub fn options(&self) -> RenderOptions {
        self.options
    }

    /// Runs `work` on the renderer's threads.
    pub(crate) fn on_threads<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }

    /// Renders one row of a tile: the mean of the samples of each pixel.
    fn render_row(&self, lens: &Lens, job: Job<'_>) {
        let Job { request: Request { tile, first, spp, sequence, .. }, y, empty, out } = job;
        let key = Key::new(self.options.seed);
        let place = Place { sample: first, sequence };
        let RenderOptions { max_depth, roulette, estimator, sampling, filter, clamp, .. } = self.options;
        let settings = Settings { max_depth, roulette, estimator };
        let mut stack = self.scene.bvh.stack();
        let (mut samples, mut dropped, mut clamped) = (0, 0, 0);
        for (i, mean) in out.iter_mut().enumerate() {
            let x = tile.x + i;
            let pixel = (y * self.width + x) as u64;
            let mut sum = glam::DVec3::ZERO;
            for k in 0..spp {
                let mut sampler = Sampler::new(sampling, key, pixel, place.plus(k));
                let [u, v, lens_u, lens_v] = sampler.four();
                let [dx, dy] = filter.offset([u, v]);
                let ray = lens.ray(x as f32 + dx, y as f32 + dy, [lens_u, lens_v]);
                let mut sample = if empty {
                    self.scene.backdrop(ray.dir)
                } else {
                    (self.sample_radiance)(&self.scene, settings, ray, &mut sampler, &mut stack)
                };
                // Also true for NaN
                if !(sample.min_element() >= 0.0 && sample.max_element() < f32::INFINITY) {
                    (sample, dropped) = (Vec3::ZERO, dropped + 1);
                }
                if let Some(limit) = clamp
                    && sample.max_element() > limit
                {
                    (sample, clamped) = (sample * (limit / sample.max_element()), clamped + 1);
                }
                sum += sample.as_dvec3();
            }
            *mean = (sum / spp as f64).as_vec3().to_array();
            samples += spp;
        }
        let add = |to: &AtomicU64, count: u64| to.fetch_add(count, Ordering::Relaxed);
        add(&self.tally.samples, samples);
        add(&self.tally.background, if empty { samples } else { 0 });
        add(&self.tally.dropped, dropped);
        add(&self.tally.clamped, clamped);
    }

    fn render(&self, requests: &[Request], batches: &mut Vec<Batch>) -> Result<(), SourceError> {
        let (width, height) = (self.width, self.height);
        for Request { tile, .. } in requests {
            let (right, bottom) = (tile.x.saturating_add(tile.width), tile.y.saturating_add(tile.height));
            if right > width || bottom > height {
                return Err(self.fail(
                    Some(tile.index),
                    OutsideError { index: tile.index, right, bottom, width, height },
                ));
            }
        }
        Batch::prepare(batches, requests);
        // Rows of tiles are the jobs: so small that no thread waits long for the last one
        let lens = self.scene.lens(width, height);
        let jobs: Vec<Job<'_>> = requests
            .iter()
            .zip(batches)
            .flat_map(|(&request, batch)| {
                let tile = request.tile;
                let empty = self.is_empty(&lens, &tile);
                let rows = batch.mean.chunks_mut(tile.width.max(1)).enumerate();
                rows.map(move |(row, out)| Job { request, y: tile.y + row, empty, out })
            })
            .collect();
        self.on_threads(|| jobs.into_par_iter().with_max_len(1).for_each(|job| self.render_row(&lens, job)));
        Ok(())
    }

    /// Whether no ray through the tile can meet a surface.
    fn is_empty(&self, lens: &Lens, tile: &Tile) -> bool {
        // Samples lie outside their pixels as far as the filter reaches
        let reach = self.options.filter.reach();
        let span = |from: usize, size: usize| [from as f32 - reach, (from + size) as f32 + reach];
        let pyramid = lens.pyramid(span(tile.x, tile.width), span(tile.y, tile.height));
        pyramid.is_some_and(|(eye, planes)| !self.scene.bvh.reaches_into(eye, &planes))
    }

    /// How Reinhard's operator would show the picture, from a small picture with few samples.
    fn preview(&self) -> Result<Display, SourceError> {
        let (width, height) = (self.width.min(PREVIEW), self.height.min(PREVIEW));
        let options = RenderOptions { threads: None, ..self.options };
        let mut small =
            Self::new(self.scene.clone(), width, height, options).map_err(|e| self.fail(None, e))?;
        let tile = Tile { index: 0, x: 0, y: 0, width, height };
        let batches = self.on_threads(|| small.sample(&[Request::new(tile, 0, 8)]))?;
        Ok(ToneMapping::default().settle(&batches[0].mean))
    }

    /// An error of this source.
    fn fail(
        &self,
        tile: Option<usize>,
        cause: impl std::error::Error + Send + Sync + 'static,
    ) -> SourceError {
        SourceError::Failed { name: self.info().name, tile, cause: Box::new(cause) }
    }
}

impl fmt::Debug for Ptwne {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scene, width, height, options, .. } = self;
        f.debug_struct("Ptwne")
            .field("scene", &scene.name())
            .field("size", &(width, height))
            .field("options", options)
            .finish_non_exhaustive()
    }
}

/// A row of a tile to render.
struct Job<'a> {
    request: Request,
    y: usize,
    /// Whether the tile sees only the background.
    empty: bool,
    out: &'a mut [Rgb],
}

impl ProgressiveSource for Ptwne {
    fn info(&self) -> SourceInfo {
        SourceInfo::new(format!("ptwne {}", self.scene.name()), self.width, self.height)
            .with_repeats(Repeats::Samples)
            .with_stratified(self.options.sampling == Sampling::Sobol)
    }

    /// Never fails.
    fn identity(&self) -> Result<SourceIdentity, SourceError> {
        // Threads do not change samples
        let options = RenderOptions { threads: None, ..self.options };
        let kept = serde_json::to_string(&(options, self.scene.camera()))
            .map_err(|error| SourceError::Failed { name: "ptwne".into(), tile: None, cause: error.into() })?;
        let mut identity = self.scene.identity().clone().with_options(&format!("ptwne, {kept}"));
        if let Some(build) = &self.program {
            identity.add("the build of this program", build.as_bytes());
        }
        Ok(identity)
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let mut batches = Vec::new();
        self.render(requests, &mut batches)?;
        Ok(batches)
    }

    fn sample_into(&mut self, requests: &[Request], batches: &mut Vec<Batch>) -> Result<(), SourceError> {
        self.render(requests, batches)
    }

    /// Never fails.
    fn first_hits(&mut self, index: u64, spp: u64) -> Result<Option<FirstHits>, SourceError> {
        let RenderOptions { seed, filter, .. } = self.options;
        let size = (self.width, self.height);
        let render = || first_hits::render(&self.scene, size, filter, (seed, index), spp.max(1));
        Ok(Some(self.on_threads(render)))
    }
}
