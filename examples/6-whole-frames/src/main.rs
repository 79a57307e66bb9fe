//! A renderer that nobody here wrote, and that can do nothing but one more sample for each pixel of the whole
//! picture:
//! [rust-pathtracer](https://crates.io/crates/rust-pathtracer). It has no seed, so that every run is another.
#![allow(clippy::print_stdout, reason = "an example prints")]

mod scene;

use noisefloor::{
    Batch, Driver, DriverError, Event, Oracle, Params, ProgressiveSource, Request, SourceError, SourceInfo,
};
use rust_pathtracer::prelude::{ColorBuffer, Tracer};
use scene::Spheres;

/// The renderer as a source.
struct WholeFrames {
    tracer: Tracer,
    width: usize,
    height: usize,
}

impl WholeFrames {
    fn new(width: usize, height: usize) -> Self {
        Self { tracer: Tracer::new(Box::new(Spheres::default())), width, height }
    }
}

impl ProgressiveSource for WholeFrames {
    fn info(&self) -> SourceInfo {
        SourceInfo::new("rust-pathtracer", self.width, self.height).with_aims(false)
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        // All tiles are asked for, and for the same number: this source cannot aim
        let samples = requests.first().map_or(0, |request| request.spp);
        let mut buffer = ColorBuffer::new(self.width, self.height); // a new one: the mean of new samples alone
        (0..samples).for_each(|_| self.tracer.render(&mut buffer));
        let at = |pixel: usize| std::array::from_fn(|channel| buffer.pixels[4 * pixel + channel]);
        let cut = |r: &Request| r.tile.rows(self.width).flatten().map(at).collect();
        Ok(requests.iter().map(|r| Batch::new(r.tile, samples, cut(r))).collect())
    }
}

fn main() -> Result<(), DriverError> {
    let source = WholeFrames::new(256, 192);
    let mut driver = Driver::new(source, Oracle::bundled(), Params::default().with_tile(64))?;
    driver.run(|_, event| {
        if let Event::TileStopped(stop) = event {
            println!("tile {:2} is done after {:5} samples per pixel", stop.tile.index, stop.spp);
        }
    })?;
    let (film, clock) = (driver.session().film(), driver.clock());
    println!(
        "{} samples per pixel for all, {:.1} s, of which {:.2} s the oracle's",
        film.total_samples() / (256 * 192),
        clock.total_seconds,
        clock.criterion_seconds
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_keeps_the_contract_of_a_source() {
        noisefloor_testkit::check_source(|| WholeFrames::new(48, 40));
        noisefloor_testkit::check_silence(WholeFrames::new(48, 40), 80);
    }
}
