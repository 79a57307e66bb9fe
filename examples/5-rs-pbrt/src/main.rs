//! A renderer that nobody here wrote: [rs_pbrt](https://crates.io/crates/rs_pbrt), pbrt-v3 in Rust, stops
//! where people stop seeing noise. Its public interface is all that is used.
#![allow(clippy::print_stdout, reason = "an example prints")]

mod cornell;
mod source;

use cornell::cornell_box;
use noisefloor::{Driver, Event, Oracle, Params};
use noisefloor_image::{RenderLayers, write_exr};
use source::Pbrt;
use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

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
    const USAGE: &str = "usage: example-rs-pbrt [path|bdpt] [EDGE], such as bdpt 128";
    let integrator = std::env::args().nth(1).unwrap_or("path".into());
    let edge = std::env::args().nth(2).map_or(Ok(192), |text| text.parse());
    let edge = edge.ok().filter(|edge| (16..=4096).contains(edge)).ok_or(USAGE)?;
    if !["path", "bdpt"].contains(&integrator.as_str()) {
        return Err(USAGE.into());
    }

    let source = Pbrt::new(&cornell_box(edge, edge, &integrator), 1)?;
    let params = Params::default().with_tile(64);
    let mut driver = Driver::new(source, Oracle::bundled(), params)?;
    driver.run(|_, event| {
        if let Event::TileStopped(stop) = event {
            println!("tile {:2} is done after {:5} samples per pixel", stop.tile.index, stop.spp);
        }
    })?;

    let (film, clock) = (driver.session().film(), driver.clock());
    let path = format!("out/rs-pbrt-{integrator}.exr");
    std::fs::create_dir_all("out")?;
    write_exr(Path::new(&path), &RenderLayers::rgb(edge, edge, &film.image()))?;
    let average = film.total_samples() as f64 / (edge * edge) as f64;
    println!(
        "{path}: {average:.0} samples per pixel on average, {:.1} s, of which {:.2} s the oracle's",
        clock.total_seconds, clock.criterion_seconds
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor_testkit::{check_silence, check_source};

    #[test]
    fn both_integrators_keep_the_contract_of_a_source() {
        for integrator in ["path", "bdpt"] {
            let make = || Pbrt::new(&cornell_box(24, 20, integrator), 3).unwrap();
            check_source(make);
            check_silence(make(), 80);
        }
    }
}
