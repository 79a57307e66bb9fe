//! Hours of renders in one process: `soak [MINUTES]` renders the same pictures again and again, each with a
//! new driver but one oracle and one source that live on, and fails if a decision or a picture differs from
//! those of a fresh process, or if memory grows. Linux only, for the size of the process.
#![allow(clippy::print_stdout, reason = "an example prints")]

use noisefloor::{Driver, Oracle, Params, ProgressiveSource};
use noisefloor_ptwne::{Ptwne, RenderOptions, scenes};
use std::error::Error;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::process::Command;
use std::time::{Duration, Instant};

const SIZE: usize = 96;
const SCENES: [&str; 3] = ["cornell-box", "courtyard", "glass-spheres"];
/// Growth of the process that passes for the allocator's own, after the first rounds.
const MOST_GROWTH: u64 = 4 << 20;
const WARM_UP: u64 = 5;

/// Decisions and picture of one render, as one number.
fn render(source: &mut impl ProgressiveSource, oracle: &Oracle) -> Result<u64, Box<dyn Error>> {
    let params = Params::default().with_tile(32).with_max_spp(1500);
    let mut driver = Driver::new(Borrowed(source), oracle.clone(), params)?;
    driver.run(|_, _| ())?;
    let mut hasher = DefaultHasher::new();
    for stop in driver.session().stops() {
        (stop.tile.index, stop.spp, stop.reason, stop.probability.map(f32::to_bits)).hash(&mut hasher);
    }
    driver.session().film().image().iter().flatten().for_each(|c| c.to_bits().hash(&mut hasher));
    Ok(hasher.finish())
}

struct Borrowed<'a, S>(&'a mut S);

impl<S: ProgressiveSource> ProgressiveSource for Borrowed<'_, S> {
    fn info(&self) -> noisefloor::SourceInfo {
        self.0.info()
    }

    fn sample(
        &mut self,
        requests: &[noisefloor::Request],
    ) -> Result<Vec<noisefloor::Batch>, noisefloor::SourceError> {
        self.0.sample(requests)
    }
}

fn source(scene: &str) -> Result<Ptwne, Box<dyn Error>> {
    let built_in = scenes::by_name(scene).ok_or("no such scene")?;
    Ok(Ptwne::new(built_in, SIZE, SIZE, RenderOptions::default())?)
}

/// Bytes of memory the process holds.
fn resident() -> Result<u64, Box<dyn Error>> {
    let pages = std::fs::read_to_string("/proc/self/statm")?;
    Ok(pages.split(' ').nth(1).ok_or("no pages in statm")?.parse::<u64>()? * 4096)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let first = args.next();
    if first.as_deref() == Some("once") {
        // The fresh process
        let scene = args.next().ok_or("once SCENE")?;
        println!("{}", render(&mut source(&scene)?, &Oracle::bundled())?);
        return Ok(());
    }
    let minutes: f64 = first.map_or(Ok(60.0), |minutes| minutes.parse())?;
    let fresh = |scene: &str| -> Result<u64, Box<dyn Error>> {
        let out = Command::new(std::env::current_exe()?).args(["once", scene]).output()?;
        Ok(String::from_utf8(out.stdout)?.trim().parse()?)
    };

    let start = Instant::now();
    let oracle = Oracle::bundled();
    let mut sources = SCENES.map(source).into_iter().collect::<Result<Vec<_>, _>>()?;
    let expected = SCENES.map(fresh).into_iter().collect::<Result<Vec<_>, _>>()?;
    let (mut rounds, mut settled, mut peak) = (0u64, 0, 0);
    while start.elapsed() < Duration::from_secs_f64(60.0 * minutes) {
        for ((scene, source), &expected) in SCENES.iter().zip(&mut sources).zip(&expected) {
            if render(source, &oracle)? != expected {
                return Err(format!("round {rounds}: {scene} is not what a fresh process makes of it").into());
            }
        }
        rounds += 1;
        let size = resident()?;
        if rounds == WARM_UP {
            settled = size;
        } else if rounds > WARM_UP {
            peak = peak.max(size);
        }
        println!(
            "{:6.0} s, round {rounds}: {:.1} MiB",
            start.elapsed().as_secs_f64(),
            size as f64 / f64::from(1 << 20)
        );
    }
    let growth = peak.saturating_sub(settled);
    println!(
        "{rounds} rounds of {} renders, each as in a fresh process; {:.1} MiB after {WARM_UP} rounds, at most {:.1} later",
        SCENES.len(),
        settled as f64 / f64::from(1 << 20),
        peak as f64 / f64::from(1 << 20),
    );
    if rounds <= WARM_UP || growth > MOST_GROWTH {
        return Err(format!("{rounds} rounds, and memory grew by {growth} bytes").into());
    }
    Ok(())
}
