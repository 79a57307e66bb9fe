//! The renderer as a source of samples.

use crate::error::{OutsideError, RenderError};
use crate::integrator::{Estimator, Settings, estimator};
use crate::rng::{Key, Rng};
use crate::scene::Scene;
use noisefloor::{Batch, ProgressiveSource, Reference, Request, Rgb, SourceError, SourceInfo, Unit};
use rayon::prelude::*;
use std::num::NonZeroUsize;
use std::sync::Arc;

/// Deepest path that can be asked for, in segments.
pub const MAX_DEPTH: u32 = 10_000;
/// Most threads that can be asked for.
pub const MAX_THREADS: usize = 1024;

/// How to render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Longest path in segments, 1…[`MAX_DEPTH`]: 1 is light seen directly, 2 is direct light.
    pub max_depth: u32,
    /// Number of segments from which on Russian roulette ends paths, at least 1.
    pub roulette: u32,
    /// Whether next events and scattering share lights by multiple importance sampling. If not, this is plain path tracing
    /// with next event estimation: lights met by scattering count only after the camera, mirrors and glass.
    pub mis: bool,
    /// Threads of a pool of its own, at most [`MAX_THREADS`]; `None`: the rayon pool that the caller is in. Images do not
    /// depend on it.
    pub threads: Option<NonZeroUsize>,
}

impl Default for Options {
    /// Seed 0, paths of up to 65 segments, roulette from the fifth on, multiple importance sampling, the caller's threads.
    fn default() -> Self {
        Self { seed: 0, max_depth: 65, roulette: 5, mis: true, threads: None }
    }
}

/// Path tracing with next event estimation, of a scene, at a resolution.
///
/// Samples are spread uniformly over each pixel (a box filter one pixel wide), all random numbers follow from (seed, pixel,
/// sample index), and the mean of a batch is summed in f64: images are the same to the bit whatever the threads, and means
/// are the same to the rounding of f32 however requests are cut.
#[derive(Debug)]
pub struct Ptwne {
    pub(crate) scene: Arc<Scene>,
    pub(crate) width: usize,
    pub(crate) height: usize,
    options: Options,
    estimator: Estimator,
    pool: Option<rayon::ThreadPool>,
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
        let pool = match options.threads.map(NonZeroUsize::get) {
            Some(threads) if threads > MAX_THREADS => return bad("threads", threads, "1…1024"),
            Some(threads) => Some(rayon::ThreadPoolBuilder::new().num_threads(threads).build()?),
            None => None,
        };
        let scene = scene.into();
        let estimator = estimator(&scene);
        Ok(Self { scene, width, height, options, estimator, pool })
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
    fn row(&self, request: &Request, y: usize, out: &mut [Rgb]) {
        let lens = self.scene.camera.lens(self.width, self.height);
        let key = Key::new(self.options.seed);
        let Options { max_depth, roulette, mis, .. } = self.options;
        let settings = Settings { max_depth, roulette, mis };
        let mut stack = self.scene.accel.stack();
        for (i, mean) in out.iter_mut().enumerate() {
            let x = request.tile.x + i;
            let pixel = (y * self.width + x) as u64;
            let mut sum = glam::DVec3::ZERO;
            for k in 0..u64::from(request.samples) {
                let mut rng = Rng::new(key, pixel, request.first.wrapping_add(k));
                let [dx, dy] = rng.two();
                let ray = lens.ray(x as f32 + dx, y as f32 + dy);
                sum += (self.estimator)(&self.scene, settings, ray, &mut rng, &mut stack).as_dvec3();
            }
            *mean = (sum / f64::from(request.samples)).as_vec3().to_array();
        }
    }

    fn fail(
        &self,
        tile: Option<usize>,
        cause: impl std::error::Error + Send + Sync + 'static,
    ) -> SourceError {
        SourceError::Failed { name: self.info().name, tile, cause: Box::new(cause) }
    }
}

impl ProgressiveSource for Ptwne {
    fn info(&self) -> SourceInfo {
        SourceInfo {
            name: format!("ptwne {}", self.scene.name()),
            width: self.width,
            height: self.height,
            unit: Unit::SamplesPerPixel,
            aims: true,
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
        let jobs: Vec<(&Request, usize, &mut [Rgb])> = requests
            .iter()
            .zip(&mut batches)
            .flat_map(|(request, batch)| {
                let rows = batch.mean.chunks_mut(request.tile.width.max(1)).enumerate();
                rows.map(move |(row, out)| (request, request.tile.y + row, out))
            })
            .collect();
        this.on_threads(|| {
            jobs.into_par_iter().with_max_len(1).for_each(|(request, y, out)| this.row(request, y, out));
        });
        Ok(batches)
    }

    fn reference(&mut self) -> Result<Option<Reference>, SourceError> {
        let pixels = self.on_threads(|| crate::reference::render(&self.scene, self.width, self.height));
        Ok(Some(Reference { width: self.width, height: self.height, pixels }))
    }
}
