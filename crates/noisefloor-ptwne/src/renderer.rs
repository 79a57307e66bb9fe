//! The renderer as a source of samples.

use crate::camera::Lens;
use crate::error::{OutsideError, RenderError};
use crate::filter::Filter;
use crate::integrator::{Estimator, Sample, Settings, integrator};
use crate::math::Vec3;
use crate::reference::{self, ReferenceNoise, Watch};
use crate::rng::Key;
use crate::sampler::{Sampler, Sampling};
use crate::scene::{Needs, Scene};
use noisefloor::{
    Batch, Display, ProgressiveSource, Reference, Repeats, Request, Rgb, SourceError, SourceInfo, Tile,
    ToneMapping, Unit,
};
use rayon::prelude::*;
use std::fmt;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Deepest path that can be asked for, in segments.
pub const MAX_DEPTH: u32 = 10_000;
/// Most threads that can be asked for.
pub const MAX_THREADS: usize = 1024;

/// Largest edge of the small picture from which the exposure of a reference is taken.
const PREVIEW: usize = 64;

/// How to render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Longest path in segments, 1…[`MAX_DEPTH`]: 1 is light seen directly, 2 is direct light.
    pub max_depth: u32,
    /// Number of segments from which on Russian roulette ends paths, at least 1.
    pub roulette: u32,
    /// How light finds its way into paths.
    pub estimator: Estimator,
    /// How the samples of a pixel are spread.
    pub sampling: Sampling,
    /// How pixels weigh the light around them.
    pub filter: Filter,
    /// Largest channel of a sample, above 0; brighter samples are scaled down to it, and counted. That loses light: `None`, the
    /// default, keeps all.
    pub clamp: Option<f32>,
    /// Threads of a pool of its own, at most [`MAX_THREADS`]; `None`: the rayon pool that the caller is in. Images do not
    /// depend on it.
    pub threads: Option<NonZeroUsize>,
}

impl Default for Options {
    /// Seed 0, paths of up to 65 segments, roulette from the fifth on, multiple importance sampling, independent samples, a box
    /// filter, no clamping, the caller's threads.
    fn default() -> Self {
        Self {
            seed: 0,
            max_depth: 65,
            roulette: 5,
            estimator: Estimator::Mis,
            sampling: Sampling::Independent,
            filter: Filter::Box,
            clamp: None,
            threads: None,
        }
    }
}

/// Path tracing with next event estimation, of a scene, at a resolution.
///
/// All random numbers follow from (seed, pixel, sample index), and the mean of a batch is summed in f64: images are the same
/// to the bit whatever the threads, and means are the same to the rounding of f32 however requests are cut. A sample counts
/// for one pixel alone, whatever the filter, so that noise is independent from pixel to pixel.
pub struct Ptwne {
    pub(crate) scene: Arc<Scene>,
    pub(crate) width: usize,
    pub(crate) height: usize,
    options: Options,
    integrator: Sample,
    pool: Option<rayon::ThreadPool>,
    tally: Tally,
    watch: Box<Watch>,
    reference_noise: Option<ReferenceNoise>,
}

/// What became of the samples so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Samples taken.
    pub samples: u64,
    /// Those that were not finite, or negative, and counted as black.
    pub dropped: u64,
    /// Those that were scaled down to [`Options::clamp`].
    pub clamped: u64,
    /// Those of tiles that see nothing but the background, for which no ray was traced.
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
        options: Options,
    ) -> Result<Self, RenderError> {
        noisefloor::check_image(width, height)?;
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
            Some(threads) => Some(rayon::ThreadPoolBuilder::new().num_threads(threads).build()?),
            None => None,
        };
        let scene = scene.into();
        let integrator = integrator(scene.needs);
        Ok(Self {
            scene,
            width,
            height,
            options,
            integrator,
            pool,
            tally: Tally::default(),
            watch: Box::new(|_, _| ControlFlow::Continue(())),
            reference_noise: None,
        })
    }

    /// Renders with code for more than the scene has. Images are the same; it shows what leaving that code out saves.
    pub fn burden(&mut self, more: Needs) {
        self.integrator = integrator(self.scene.needs.with(more));
    }

    /// What became of the samples so far.
    pub fn counts(&self) -> Counts {
        let read = |a: &AtomicU64| a.load(Ordering::Relaxed);
        let Tally { samples, dropped, clamped, background } = &self.tally;
        Counts {
            samples: read(samples),
            dropped: read(dropped),
            clamped: read(clamped),
            background: read(background),
        }
    }

    /// Has `watch` told, while a reference is rendered, how many of how many blocks of it are there; on [`ControlFlow::Break`] it is given
    /// up. Comes from any thread.
    pub fn watch_reference(
        &mut self,
        watch: impl Fn(usize, usize) -> ControlFlow<()> + Send + Sync + 'static,
    ) {
        self.watch = Box::new(watch);
    }

    /// What noise the last reference has, once there is one.
    pub fn reference_noise(&self) -> Option<&ReferenceNoise> {
        self.reference_noise.as_ref()
    }

    /// The options.
    pub fn options(&self) -> Options {
        self.options
    }

    /// Runs `work` on this renderer's threads.
    pub(crate) fn on_threads<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }

    /// The mean of the samples of each pixel of one row of a tile.
    fn row(&self, lens: &Lens, job: Job<'_>) {
        let Job { request, y, empty, out } = job;
        let key = Key::new(self.options.seed);
        let Options { max_depth, roulette, estimator, sampling, filter, clamp, .. } = self.options;
        let settings = Settings { max_depth, roulette, estimator };
        let mut stack = self.scene.accel.stack();
        let (mut dropped, mut clamped) = (0, 0);
        for (i, mean) in out.iter_mut().enumerate() {
            let x = request.tile.x + i;
            let pixel = (y * self.width + x) as u64;
            let mut sum = glam::DVec3::ZERO;
            for k in 0..u64::from(request.samples) {
                let mut sampler = Sampler::new(sampling, key, pixel, request.first.wrapping_add(k));
                let [u, v, ..] = sampler.four();
                let [dx, dy] = filter.offset([u, v]);
                let ray = lens.ray(x as f32 + dx, y as f32 + dy);
                let mut sample = if empty {
                    self.scene.beyond(ray.dir, |_, _| 1.0)
                } else {
                    (self.integrator)(&self.scene, settings, ray, &mut sampler, &mut stack)
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
            *mean = (sum / f64::from(request.samples)).as_vec3().to_array();
        }
        let add = |to: &AtomicU64, count: u64| to.fetch_add(count, Ordering::Relaxed);
        let samples = out.len() as u64 * u64::from(request.samples);
        add(&self.tally.samples, samples);
        add(&self.tally.background, if empty { samples } else { 0 });
        add(&self.tally.dropped, dropped);
        add(&self.tally.clamped, clamped);
    }

    /// Whether no ray through the tile can meet a surface.
    fn is_empty(&self, lens: &Lens, tile: &Tile) -> bool {
        // Samples of neighbouring pixels' light reach as far as the filter
        let reach = self.options.filter.reach();
        let span = |from: usize, size: usize| [from as f32 - reach, (from + size) as f32 + reach];
        let (eye, planes) = lens.pyramid(span(tile.x, tile.width), span(tile.y, tile.height));
        !self.scene.accel.reaches_into(eye, &planes)
    }

    /// How the picture would be shown by Reinhard's operator, from a small one of few samples.
    fn preview(&self) -> Result<Display, SourceError> {
        let (width, height) = (self.width.min(PREVIEW), self.height.min(PREVIEW));
        let options = Options { threads: None, ..self.options };
        let mut small =
            Self::new(self.scene.clone(), width, height, options).map_err(|e| self.fail(None, e))?;
        let tile = Tile { index: 0, x: 0, y: 0, width, height };
        let batches = self.on_threads(|| small.sample(&[Request { tile, first: 0, samples: 8 }]))?;
        Ok(ToneMapping::default().settle(&batches[0].mean))
    }

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

/// A row of a tile.
struct Job<'a> {
    request: &'a Request,
    y: usize,
    /// Whether the tile sees nothing but the background.
    empty: bool,
    out: &'a mut [Rgb],
}

impl ProgressiveSource for Ptwne {
    fn info(&self) -> SourceInfo {
        SourceInfo {
            name: format!("ptwne {}", self.scene.name()),
            width: self.width,
            height: self.height,
            unit: Unit::SamplesPerPixel,
            aims: true,
            repeats: Repeats::Samples,
        }
    }

    /// # Errors
    /// [`SourceError::Failed`] if a tile reaches out of the image.
    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let this = &*self;
        let (width, height) = (this.width, this.height);
        for Request { tile, .. } in requests {
            let (right, bottom) = (tile.x.saturating_add(tile.width), tile.y.saturating_add(tile.height));
            if right > width || bottom > height {
                return Err(this.fail(
                    Some(tile.index),
                    OutsideError { index: tile.index, right, bottom, width, height },
                ));
            }
        }
        let mut batches: Vec<Batch> = requests
            .iter()
            .map(|r| {
                let pixels = if r.samples == 0 { 0 } else { r.tile.pixels() };
                Batch { tile: r.tile, samples: r.samples, mean: vec![[0.0; 3]; pixels] }
            })
            .collect();
        // Rows of all tiles are the jobs: small enough that no thread waits long for the last one
        let lens = this.scene.lens(width, height);
        let jobs: Vec<Job<'_>> = requests
            .iter()
            .zip(&mut batches)
            .flat_map(|(request, batch)| {
                let empty = this.is_empty(&lens, &request.tile);
                let rows = batch.mean.chunks_mut(request.tile.width.max(1)).enumerate();
                rows.map(move |(row, out)| Job { request, y: request.tile.y + row, empty, out })
            })
            .collect();
        this.on_threads(|| jobs.into_par_iter().with_max_len(1).for_each(|job| this.row(&lens, job)));
        Ok(batches)
    }

    /// # Errors
    /// [`SourceError::Failed`] if it was given up, see [`Ptwne::watch_reference`].
    fn reference(&mut self) -> Result<Option<Reference>, SourceError> {
        let key = Key::new(self.options.seed);
        let display = self.preview()?;
        let size = [self.width, self.height];
        let picture =
            self.on_threads(|| reference::render(&self.scene, size, key, &display, self.watch.as_ref()));
        let picture = picture.ok_or_else(|| self.fail(None, RenderError::GivenUp))?;
        self.reference_noise = Some(picture.noise);
        Ok(Some(Reference { width: self.width, height: self.height, pixels: picture.pixels }))
    }
}
