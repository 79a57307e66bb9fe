//! Films and sources of known noise, for tests.

use noisefloor::{
    Batch, Film, ProgressiveSource, Repeats, Request, Rgb, SourceError, SourceInfo, TileGrid,
    criterion::View, display::Display,
};
use noisefloor_testkit::Noise;

static SRGB: Display = Display::SRGB;

/// A look at a film through plain sRGB.
pub(crate) fn view(film: &Film) -> View<'_> {
    View::new(film, &SRGB)
}

/// An empty film of 64×64 pixels in four tiles.
pub(crate) fn empty() -> Film {
    Film::new(TileGrid::new(64, 64, 32).unwrap())
}

/// Adds `samples` samples of grey noise to each tile: `mean` with a standard deviation of `sigma` a sample.
pub(crate) fn expose(film: &mut Film, samples: u64, mean: f64, sigma: f64, noise: &mut Noise) {
    for tile in film.grid().tiles() {
        let deviation = sigma / (samples as f64).sqrt();
        let batch: Vec<Rgb> =
            (0..tile.pixels()).map(|_| [(mean + deviation * noise.normal()) as f32; 3]).collect();
        film.add(tile.index, samples, &batch).unwrap();
    }
}

/// A film of one value everywhere, in both halves.
pub(crate) fn constant(value: f32, samples: u64) -> Film {
    let mut film = empty();
    for _ in 0..2 {
        for tile in film.grid().tiles() {
            film.add(tile.index, samples / 2, &vec![[value; 3]; tile.pixels()]).unwrap();
        }
    }
    film
}

/// A picture with noise that is normally distributed, of a standard deviation of `sigma` times the picture;
/// deterministic.
#[derive(Clone)]
pub(crate) struct NoisySource {
    pub(crate) edge: usize,
    pub(crate) picture: fn(usize, usize) -> f64,
    pub(crate) sigma: f64,
}

impl ProgressiveSource for NoisySource {
    fn info(&self) -> SourceInfo {
        SourceInfo::new("noise", self.edge, self.edge).with_repeats(Repeats::Calls)
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let sample = |r: &Request| {
            let mut noise = Noise::keyed(&[r.first, r.tile.index as u64]);
            let deviation = self.sigma / (r.spp as f64).sqrt();
            let pixels =
                (0..r.tile.pixels()).map(|i| (r.tile.x + i % r.tile.width, r.tile.y + i / r.tile.width));
            let value = |(x, y)| [((self.picture)(x, y) * (1.0 + deviation * noise.normal())) as f32; 3];
            Batch::new(r.tile, r.spp, pixels.map(value).collect())
        };
        Ok(requests.iter().map(sample).collect())
    }
}
