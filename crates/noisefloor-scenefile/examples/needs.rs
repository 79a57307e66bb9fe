//! What leaving out saves: `needs ROUNDS SCENE…`, scenes by name or file. Renders each scene with the code that it needs, and with
//! code for more, turn by turn, and prints a table in Markdown: the ratios of median times.

#![expect(clippy::print_stdout, reason = "a table for people")]

use noisefloor::{ProgressiveSource, Request, TileGrid};
use noisefloor_ptwne::{Needs, Options, Ptwne, Scene, scenes};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

const SIZE: usize = 256;
const SAMPLES: u32 = 4;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [rounds, names @ ..] = args.as_slice() else { return Err("needs ROUNDS SCENE…".into()) };
    let rounds: usize = rounds.parse()?;
    println!(
        "| scene | needs | M samples/s | + textures | + glossy | + specular | + sky | + holes | + all | background | idle lights | bytes a surface |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    for name in names {
        let scene = match scenes::by_name(name) {
            Some(scene) => scene,
            None => noisefloor_scenefile::load(Path::new(name))?.scene,
        };
        println!("{}", row(&Arc::new(scene), rounds)?);
    }
    Ok(())
}

fn row(scene: &Arc<Scene>, rounds: usize) -> Result<String, Box<dyn Error>> {
    let none = Needs::default();
    let kinds = [
        ("", none),
        ("textures", Needs { textures: true, ..none }),
        ("glossy", Needs { glossy: true, ..none }),
        ("specular", Needs { specular: true, ..none }),
        ("sky", Needs { sky: true, ..none }),
        ("holes", Needs { holes: true, ..none }),
        ("all", Needs::ALL),
    ];
    let has = scene.needs();
    let mut sources = Vec::new();
    for (name, more) in kinds {
        // What the scene has anyway is not measured again
        if name.is_empty() || has.with(more) != has {
            let mut source = Ptwne::new(scene.clone(), SIZE, SIZE, Options::default())?;
            source.burden(more);
            sources.push((name, source, Vec::new()));
        }
    }
    for round in 0..=rounds {
        for (_, source, times) in &mut sources {
            let first = round as u64 * u64::from(SAMPLES);
            let tiles = TileGrid::new(SIZE, SIZE, 64)?.tiles();
            let requests: Vec<Request> =
                tiles.map(|tile| Request { tile, first, samples: SAMPLES }).collect();
            let start = Instant::now();
            source.sample(&requests)?;
            // The first round warms up
            if round > 0 {
                times.push(start.elapsed().as_secs_f64());
            }
        }
    }
    let medians: Vec<(&str, f64)> = sources
        .iter_mut()
        .map(|(name, _, times)| {
            times.sort_by(f64::total_cmp);
            (*name, times[times.len() / 2])
        })
        .collect();
    let own = medians[0].1;
    let mut cells = vec![scene.name().to_owned()];
    let held: Vec<&str> =
        kinds[1..6].iter().filter(|(_, n)| has.with(*n) == has).map(|(name, _)| *name).collect();
    cells.push(if held.is_empty() { "nothing".into() } else { held.join(", ") });
    cells.push(format!("{:.2}", (SIZE * SIZE) as f64 * f64::from(SAMPLES) / own / 1e6));
    for (name, _) in &kinds[1..] {
        let found = medians.iter().find(|(n, _)| n == name);
        cells.push(found.map_or_else(|| "has".into(), |(_, time)| format!("×{:.2}", time / own)));
    }
    let counts = sources[0].1.counts();
    cells.push(format!("{:.0} %", 100.0 * counts.background as f64 / counts.samples as f64));
    cells.push(format!("{} of {}", scene.idle_lights(), scene.lights()));
    cells.push(format!("{}", scene.geometry_bytes() / scene.surfaces().max(1)));
    Ok(format!("| {} |", cells.join(" | ")))
}
