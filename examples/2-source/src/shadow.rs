//! The renderer of the first example as a source: in colour, from a seed, on all cores.

use noisefloor::{Batch, ProgressiveSource, Repeats, Request, Rgb, SourceError, SourceInfo};
use std::num::NonZeroUsize;
use std::thread;

/// A checkered floor in the light of a square lamp, and the shadow of a ball that hangs between them.
pub(crate) struct Shadow {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) seed: u64,
}

impl ProgressiveSource for Shadow {
    fn info(&self) -> SourceInfo {
        SourceInfo::new("shadow of a ball", self.width, self.height).with_repeats(Repeats::Samples)
    }

    /// All open tiles come in one call, so that there is work for every core up to the last tile.
    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let this = &*self;
        let cores = thread::available_parallelism().map_or(1, NonZeroUsize::get);
        let mut batches = Vec::with_capacity(requests.len());
        thread::scope(|scope| {
            let share = requests.len().div_ceil(cores).max(1);
            let work = |part: &'_ [Request]| part.iter().map(|r| this.batch(r)).collect::<Vec<_>>();
            let threads: Vec<_> =
                requests.chunks(share).map(|part| scope.spawn(move || work(part))).collect();
            for thread in threads {
                batches.extend(thread.join().map_err(|_| this.failed("a thread of the renderer panicked"))?);
            }
            Ok(batches)
        })
    }
}

impl Shadow {
    /// What the driver wants: the mean of the *new* samples alone, and how many they are.
    fn batch(&self, request: &Request) -> Batch {
        let &Request { tile, first, spp: samples, .. } = request;
        let pixel = |i: usize| {
            let (x, y) = (tile.x + i % tile.width, tile.y + i / tile.width);
            let mut sum = [0.0; 3];
            for n in first..first + samples {
                let radiance = self.radiance(x, y, n);
                sum.iter_mut().zip(radiance).for_each(|(sum, value)| *sum += value);
            }
            sum.map(|sum| sum / samples as f32)
        };
        Batch::new(tile, samples, (0..tile.pixels()).map(pixel).collect())
    }

    /// Sample `n` of a pixel. All random numbers follow from (seed, pixel, n): the same picture whatever the
    /// threads, and however the driver cuts its requests.
    fn radiance(&self, x: usize, y: usize, n: u64) -> Rgb {
        let pixel = (y * self.width + x) as u64;
        let key = random_bits(random_bits(self.seed) ^ pixel);
        let [dx, dy, u, v] = [0, 1, 2, 3].map(|dimension| random(key.wrapping_add(4 * n + dimension)));

        // The floor runs away towards the top of the picture.
        let across = (x as f32 + dx) / self.width as f32 - 0.5;
        let depth = 1.2 / ((y as f32 + dy) / self.height as f32 + 0.08);
        let floor = [1.9 * across * depth, depth];
        let dark_square = (floor[0].floor() + floor[1].floor()) as i32 & 1 == 1;
        let colour = if dark_square { [0.35, 0.12, 0.08] } else { [0.8, 0.75, 0.65] };

        // One point of the lamp, behind the ball or not.
        let to_lamp = [0.8 * u - 0.4 - floor[0], 4.0, 0.8 * v + 2.6 - floor[1]];
        let to_ball = [-floor[0], 2.0, 2.5 - floor[1]];
        let (square, along) = (dot(to_lamp, to_lamp), dot(to_lamp, to_ball));
        let in_shadow = dot(to_ball, to_ball) - along * along / square < 0.25;
        let light = if in_shadow { 0.05 } else { 0.05 + 64.0 / (square * square) };
        colour.map(|c| c * light)
    }

    fn failed(&self, cause: &str) -> SourceError {
        SourceError::Failed { name: self.info().name, tile: None, cause: cause.into() }
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Bits that depend on `n` alone (SplitMix64).
fn random_bits(n: u64) -> u64 {
    let z = n.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A number in [0, 1) that depends on `n` alone.
fn random(n: u64) -> f32 {
    (random_bits(n) >> 40) as f32 / (1 << 24) as f32
}
