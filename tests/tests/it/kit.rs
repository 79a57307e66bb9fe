use noisefloor::{
    Batch, Counts, ProgressiveSource, Repeats, Request, Rgb, SourceError, SourceInfo, Unit,
    source::{FirstHits, PixelNoise, Reference},
};
use noisefloor_denoise::{DenoiseError, Denoiser, NoisyPicture};
use noisefloor_sidecar::{Renderer, find, probe};
use noisefloor_testkit::{Noise, Requirement, bilateral, require};
use std::collections::BTreeMap;
use std::sync::Mutex;

pub(crate) struct Bilateral;

impl Denoiser for Bilateral {
    fn name(&self) -> String {
        "bilateral".into()
    }

    fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError> {
        Ok(bilateral(picture.size, picture.radiance, 0.1))
    }
}

/// Noise without a renderer. A sample of a pixel is `radiance`·(1 ± `noise`), one as likely as the other. All
/// follows from (seed, pixel, sample).
#[derive(Clone)]
pub(crate) struct Synthetic {
    pub(crate) size: (usize, usize),
    pub(crate) seed: u64,
    pub(crate) radiance: fn(usize, usize) -> f32,
    /// Relative standard deviation of one sample, 0…1.
    pub(crate) noise: fn(usize, usize) -> f32,
    /// Samples per pixel that it has.
    pub(crate) store: u64,
    pub(crate) aims: bool,
    pub(crate) repeats: Repeats,
    pub(crate) counts: Counts,
    pub(crate) unit: Unit,
    pub(crate) pixels: PixelNoise,
}

impl Synthetic {
    /// A ramp with a checker, noisier to the right.
    pub(crate) fn new(width: usize, height: usize) -> Self {
        let radiance = |x, y| 0.2 + 0.01 * (x % 64) as f32 + if (x / 6 + y / 6) % 2 == 0 { 0.1 } else { 0.0 };
        let noise = |x, _| (0.3 + 0.007 * x as f32).min(1.0);
        Self {
            size: (width, height),
            seed: 1,
            radiance,
            noise,
            store: u64::MAX,
            aims: true,
            repeats: Repeats::Samples,
            counts: Counts::Asked,
            unit: Unit::SamplesPerPixel,
            pixels: PixelNoise::Independent,
        }
    }

    pub(crate) fn flat(width: usize, height: usize, radiance: fn(usize, usize) -> f32) -> Self {
        Self { radiance, noise: |_, _| 0.0, ..Self::new(width, height) }
    }

    fn mean(&self, x: usize, y: usize, first: u64, samples: u64) -> Rgb {
        let (radiance, noise) = ((self.radiance)(x, y), f64::from((self.noise)(x, y)));
        let bright = self.bright((y * self.size.0 + x) as u64, first, first + samples);
        let factor = 1.0 + noise * (2.0 * f64::from(bright) / samples as f64 - 1.0);
        [1.0, 0.8, 0.5].map(|c| c * radiance * factor as f32)
    }

    /// How many samples of a pixel are bright: each has a bit of a random word that 64 of them share.
    fn bright(&self, pixel: u64, first: u64, end: u64) -> u32 {
        let mut bright = 0;
        let mut sample = first;
        while sample < end {
            let word = Noise::keyed(&[self.seed, pixel, sample / 64]).bits() >> (sample % 64);
            let taken = (64 - sample % 64).min(end - sample);
            bright += (word & (u64::MAX >> (64 - taken))).count_ones();
            sample += taken;
        }
        bright
    }
}

impl ProgressiveSource for Synthetic {
    fn info(&self) -> SourceInfo {
        let (width, height) = self.size;
        SourceInfo::new("synthetic", width, height)
            .with_pixels(self.pixels)
            .with_unit(self.unit)
            .with_aims(self.aims)
            .with_repeats(self.repeats)
            .with_counts(self.counts)
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let batch = |r: &Request| {
            let samples = r.spp.min(self.store.saturating_sub(r.first));
            let pixels = if samples == 0 { 0 } else { r.tile.pixels() };
            let at = |i: usize| (r.tile.x + i % r.tile.width, r.tile.y + i / r.tile.width);
            let mean = (0..pixels).map(at).map(|(x, y)| self.mean(x, y, r.first, samples)).collect();
            Batch::new(r.tile, samples, mean)
        };
        Ok(requests.iter().map(batch).collect())
    }
}

/// Given the requests and the right batches, makes others of them.
pub(crate) type Change = Box<dyn FnMut(&[Request], &mut Vec<Batch>)>;

/// A source with one thing changed: its batches, or its reference.
pub(crate) struct Altered<S> {
    pub(crate) source: S,
    pub(crate) batches: Change,
    pub(crate) render_reference: Box<dyn FnMut() -> Option<Reference>>,
    pub(crate) first_hits: Box<dyn FnMut(u64) -> Option<FirstHits>>,
}

impl<S: ProgressiveSource> Altered<S> {
    pub(crate) fn batches(source: S, change: impl FnMut(&[Request], &mut Vec<Batch>) + 'static) -> Self {
        Self { batches: Box::new(change), ..Self::reference(source, || None) }
    }

    pub(crate) fn reference(source: S, reference: impl FnMut() -> Option<Reference> + 'static) -> Self {
        let (batches, first_hits): (Change, _) = (Box::new(|_, _| ()), Box::new(|_| None));
        Self { source, batches, render_reference: Box::new(reference), first_hits }
    }

    pub(crate) fn render_reference(&mut self) -> Option<Reference> {
        (self.render_reference)()
    }

    pub(crate) fn first_hits(source: S, first_hits: impl FnMut(u64) -> Option<FirstHits> + 'static) -> Self {
        Self { first_hits: Box::new(first_hits), ..Self::reference(source, || None) }
    }
}

impl<S: ProgressiveSource> ProgressiveSource for Altered<S> {
    fn info(&self) -> SourceInfo {
        self.source.info()
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let mut batches = self.source.sample(requests)?;
        (self.batches)(requests, &mut batches);
        Ok(batches)
    }

    fn first_hits(&mut self, index: u64, _spp: u64) -> Result<Option<FirstHits>, SourceError> {
        Ok((self.first_hits)(index))
    }
}

/// Whether a renderer in another process can be used here; `require` says so if not.
pub(crate) fn usable(renderer: &Renderer) -> bool {
    // Loading one takes seconds, and many tests ask
    static PROBED: Mutex<BTreeMap<&str, Result<String, String>>> = Mutex::new(BTreeMap::new());
    let probe = || find(renderer).and_then(|python| probe(renderer, &python)).map_err(|e| e.to_string());
    let probed = PROBED.lock().unwrap().entry(renderer.name).or_insert_with(probe).clone();
    require(Requirement::Renderers, probed).is_some()
}
