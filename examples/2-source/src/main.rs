//! Source: the renderer becomes a [`noisefloor::ProgressiveSource`], and the driver runs it: events, a time
//! limit, a table.
#![allow(clippy::print_stdout, reason = "an example prints")]

mod shadow;

use noisefloor::{Driver, Event, Oracle, Params, StopReason, driver::Progress};
use shadow::Shadow;
use std::error::Error;
use std::process::ExitCode;
use std::time::Duration;

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
    // One argument: the most seconds that it may take.
    let typed = std::env::args().nth(1).map_or(Ok(30.0), |text| text.parse());
    let limit = typed.ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    let limit = limit.ok_or("usage: example-source [SECONDS], such as 0.5")?;

    let params = Params::default().with_tile(64);
    let source = Shadow { width: 480, height: 320, seed: 1 };
    let mut driver = Driver::new(source, Oracle::bundled(), params)?;
    driver.set_time_limit(Some(limit));

    // Run. Whatever ends it, all samples are in the film, and every tile has a stop that says why.
    let mut told = -1.0;
    driver.run(|_session, event| match event {
        Event::BatchDone(progress) if progress.now.seconds > told + 0.5 => {
            told = progress.now.seconds;
            tell(progress);
        }
        _ => (), // Event::TileStopped tells of each tile as it is done.
    })?;

    // A table of the stops, laid out as the tiles are.
    let grid = driver.session().film().grid();
    println!("\nsamples per pixel of each tile (* where time was up):");
    for stop in driver.session().stops() {
        let mark = if stop.reason == StopReason::TimeLimit { '*' } else { ' ' };
        let end = if (stop.tile.index + 1).is_multiple_of(grid.columns()) { "\n" } else { "" };
        print!("{:6}{mark}{end}", stop.spp);
    }

    // What it took.
    let film = driver.session().film();
    let most = driver.session().stops().map(|stop| stop.spp).max().unwrap_or(0);
    let uniform = most as f64 * (grid.width() * grid.height()) as f64;
    let clock = driver.clock();
    println!(
        "\n{:.1} s, {:.2} % of them in the oracle; {:.0} million samples, {:.0} % of what {most} spp everywhere would take",
        clock.total_seconds,
        100.0 * clock.criterion_seconds / clock.total_seconds,
        film.total_samples() as f64 / 1e6,
        100.0 * film.total_samples() as f64 / uniform
    );
    Ok(())
}

fn tell(progress: &Progress) {
    let eta = progress.eta_seconds.map_or("no estimate yet".into(), |s| format!("about {s:.1} s to go"));
    println!(
        "{:5.1} s  {:2} of {} tiles open  {eta}",
        progress.now.seconds, progress.now.active_tiles, progress.tiles
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor_testkit::{check_silence, check_source};

    #[test]
    fn it_keeps_the_contract_of_a_source() {
        let make = || Shadow { width: 48, height: 40, seed: 1 };
        check_source(make);
        check_silence(make(), 80);
    }
}
