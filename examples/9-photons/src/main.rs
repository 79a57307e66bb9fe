//! A renderer that nobody here wrote, and that is no path tracer: [rustic-zen](https://crates.io/crates/rustic-zen)
//! follows light across a plane and draws its way as lines. It draws whole frames, and has no seed, so that every
//! run is another.
#![allow(clippy::print_stdout, reason = "an example prints")]

mod scene;

use noisefloor::{
    Batch, Driver, Event, Oracle, Params, ProgressiveSource, Request, SourceError, SourceInfo,
    source::PixelNoise,
};
use noisefloor_image::{RenderLayers, write_exr};
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use rustic_zen::prelude::{ExportImage, Image, RenderConstraint};
use std::error::Error;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

/// The renderer as a source.
struct Photons {
    width: usize,
    height: usize,
    /// What is called one sample per pixel: so many rays in the whole picture. Any number would do; with this one
    /// a picture converges within hundreds or thousands.
    rays: usize,
}

impl Photons {
    /// The sum of the rays of one sample: red, green, blue and 1 for each pixel. On one thread, since rustic-zen's
    /// own threads add to a picture without a lock, and now and then lose what another has added.
    fn draw(&self) -> Vec<f32> {
        let mut image = Arc::new(Image::new(self.width, self.height));
        scene::lamps(self.width, self.height).render(RenderConstraint::Count(self.rays), 1, &mut image);
        image.to_rgbaf32()
    }
}

impl ProgressiveSource for Photons {
    fn info(&self) -> SourceInfo {
        SourceInfo::new("rustic-zen", self.width, self.height)
            .with_aims(false)
            .with_pixels(PixelNoise::Shared)
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        // All tiles are asked for, and for the same number: this source cannot aim
        let samples = requests.first().map_or(0, |request| request.spp);
        let black = || vec![0.0; 4 * self.width * self.height];
        let add = |sum: Vec<f32>, part: Vec<f32>| sum.iter().zip(&part).map(|(a, b)| a + b).collect();
        let sum = (0..samples).into_par_iter().map(|_| self.draw()).reduce(black, add);
        let scale = 1.0 / (self.rays as f32 * samples as f32);
        let at = |pixel: usize| std::array::from_fn(|channel| sum[4 * pixel + channel] * scale);
        let cut = |r: &Request| r.tile.rows(self.width).flatten().map(at).collect();
        Ok(requests.iter().map(|r| Batch::new(r.tile, samples, cut(r))).collect())
    }
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let (width, height, rays) = (384, 256, 2000);
    let source = Photons { width, height, rays };
    let mut driver = Driver::new(source, Oracle::bundled(), Params::default().with_tile(64))?;
    driver.run(|_, event| {
        if let Event::TileStopped(stop) = event {
            println!("people see no noise in tile {:2} after {:5} samples", stop.tile.index, stop.spp);
        }
    })?;
    let (film, clock) = (driver.session().film(), driver.clock());
    std::fs::create_dir_all("out")?;
    write_exr(Path::new("out/photons.exr"), &RenderLayers::rgb(width, height, &film.image()))?;
    println!(
        "out/photons.exr: about {} million rays, {:.1} s, of which {:.2} s the oracle's",
        film.total_samples() as usize / (width * height) * rays / 1_000_000,
        clock.total_seconds,
        clock.criterion_seconds
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor::TileGrid;

    /// Light of the whole picture in 16 batches of so many samples: its mean, and the variance of that mean.
    fn light(spp: u64) -> (f64, f64) {
        let mut source = Photons { width: 48, height: 40, rays: 20 };
        let tile = TileGrid::new(48, 40, 48).unwrap().tile(0);
        let mut batch = || {
            let batch = source.sample(&[Request::new(tile, 0, spp)]).unwrap().remove(0);
            assert!(batch.spp == spp && batch.mean.len() == 48 * 40);
            batch.mean.iter().flatten().map(|&c| f64::from(c)).sum::<f64>()
        };
        let lights: Vec<f64> = (0..16).map(|_| batch()).collect();
        let mean = lights.iter().sum::<f64>() / 16.0;
        (mean, lights.iter().map(|light| (light - mean).powi(2)).sum::<f64>() / (15.0 * 16.0))
    }

    /// Lines cross many pixels, as the source says.
    #[test]
    fn nothing_is_wrong_with_its_samples() {
        noisefloor_testkit::check_silence(Photons { width: 48, height: 40, rays: 20 }, 80);
    }

    #[test]
    fn light_does_not_depend_on_how_it_is_asked_for() {
        let ((few, error), (many, other)) = (light(2), light(16));
        // By chance beyond 6 standard errors at most once in 40,000 runs (Student's t, 15 degrees of freedom)
        assert!(few > 0.0 && (few - many).abs() < 6.0 * (error + other).sqrt(), "{few} {many}");
    }
}
