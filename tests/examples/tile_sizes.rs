//! What smaller tiles do: `tile_sizes [SCENE]…` renders built-in scenes with one model at tiles of 128, 64,
//! 32 and 16 pixels, and prints a Markdown table of samples, agreement with tiles of 128, and seams.
#![allow(clippy::print_stdout, reason = "an example prints")]

use noisefloor::{
    Driver, FixedSpp, Oracle, Params, Rgb, Session, Stop, StoppingCriterion,
    descriptor::NoiseMask,
    display::{Display, luminance},
    evidence::Plane,
    tile::DEFAULT_TILE,
};
use noisefloor_ptwne::{Ptwne, RenderOptions, scenes};
use std::error::Error;

const EDGE: usize = 256;
/// Edges of the tiles.
const TILES: [usize; 4] = [DEFAULT_TILE, 64, 32, 16];
/// The largest stop.
const MOST: u64 = 2000;
/// Samples of the picture that all others are held against.
const CONVERGED: u64 = 2000;
/// Samples of the evenly sampled picture, in which tiles have no borders.
const EVEN: u64 = 400;
/// Noise beside a border is compared with noise so many pixels deeper in the same tile.
const DEEPER: usize = 4;

fn main() -> Result<(), Box<dyn Error>> {
    let mut names: Vec<String> = std::env::args().skip(1).collect();
    if names.is_empty() {
        names = ["cornell-box", "softbox", "courtyard"].map(str::to_owned).to_vec();
    }
    println!(
        "| scene | tile | mean spp | samples against 128 | within ×1.5 of 128 | median ratio | seams | by chance | step |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for name in names {
        measure(&name)?;
    }
    Ok(())
}

fn measure(name: &str) -> Result<(), Box<dyn Error>> {
    let converged = render(name, 2, FixedSpp(CONVERGED), TILES[0], CONVERGED)?;
    let even = |seed| render(name, seed, FixedSpp(EVEN), TILES[0], EVEN).map(|s| s.film().image());
    let (even, also_even) = (even(3)?, even(4)?);
    let converged = converged.film().image();
    let mut at_128: Vec<f64> = Vec::new();
    for tile in TILES {
        let session = render(name, 1, Oracle::bundled(), tile, MOST)?;
        let display = session.display().ok_or("no verdict was given")?.clone();
        let mut spp = vec![0.0; EDGE * EDGE];
        for Stop { tile, .. } in session.stops() {
            let samples = session.film().spp(tile.index) as f64;
            tile.rows(EDGE).flatten().for_each(|pixel| spp[pixel] = samples);
        }
        if at_128.is_empty() {
            at_128.clone_from(&spp);
        }
        let total = |spp: &[f64]| spp.iter().sum::<f64>();
        let mut ratios: Vec<f64> = spp.iter().zip(&at_128).map(|(here, there)| here / there).collect();
        ratios.sort_by(f64::total_cmp);
        let within = ratios.iter().filter(|r| (1.0 / 1.5..=1.5).contains(*r)).count();

        // Noise beside the borders against noise deeper in the tile; the same places of a picture without
        // borders take out what scene and geometry do.
        let edges = borders(tile, &spp);
        let energy = |image: &[Rgb]| noise_energy(image, &converged, &display);
        let (tiled, plain) = (energy(&session.film().image()), energy(&even));
        let seams = beside(&edges, &tiled) / beside(&edges, &plain);
        let chance = beside(&edges, &energy(&also_even)) / beside(&edges, &plain);
        let steps = edges.iter().map(|e| (spp[e.near] / spp[e.beyond]).ln().abs());
        let step = (0.5 * steps.sum::<f64>() / edges.len().max(1) as f64).exp();
        println!(
            "| {name} | {tile} | {:.0} | {:+.0} % | {:.0} % | {:.2} | {seams:.2} | {chance:.2} | ×{step:.2} |",
            total(&spp) / spp.len() as f64,
            100.0 * (total(&spp) / total(&at_128) - 1.0),
            100.0 * within as f64 / ratios.len() as f64,
            ratios[ratios.len() / 2],
        );
    }
    Ok(())
}

fn render<C: StoppingCriterion>(
    name: &str,
    seed: u64,
    criterion: C,
    tile: usize,
    max_spp: u64,
) -> Result<Session<C>, Box<dyn Error>> {
    let scene = scenes::by_name(name).ok_or_else(|| format!("no built-in scene {name:?}"))?;
    let source = Ptwne::new(scene, EDGE, EDGE, RenderOptions { seed, ..RenderOptions::default() })?;
    let mut driver = Driver::new(source, criterion, Params::default().with_tile(tile).with_max_spp(max_spp))?;
    driver.run(|_, _| ())?;
    Ok(driver.into_parts().1)
}

/// Energy of the noise mask of what two pictures differ by, in display luminance.
fn noise_energy(image: &[Rgb], converged: &[Rgb], display: &Display) -> Plane {
    let shown = |p: Rgb| luminance(display.encode(p));
    let noise =
        Plane::from_fn((EDGE, EDGE), |(y, x)| shown(image[y * EDGE + x]) - shown(converged[y * EDGE + x]));
    let mask = NoiseMask::default().apply(&noise);
    Plane::from_fn((EDGE, EDGE), |at| mask[at] * mask[at])
}

/// A pixel at a border between tiles that stopped apart, the one deeper in its tile, and the one beyond the
/// border.
struct Edge {
    near: usize,
    deep: usize,
    beyond: usize,
}

fn borders(tile: usize, spp: &[f64]) -> Vec<Edge> {
    let mut edges = Vec::new();
    for border in (tile..EDGE).step_by(tile) {
        for along in 0..EDGE {
            // Across a vertical border, then across a horizontal one; from either side.
            for at in
                [|across: usize, along: usize| along * EDGE + across, |across, along| across * EDGE + along]
            {
                let (before, after) = (at(border - 1, along), at(border, along));
                if spp[before] != spp[after] {
                    edges.push(Edge { near: before, deep: at(border - 1 - DEEPER, along), beyond: after });
                    edges.push(Edge { near: after, deep: at(border + DEEPER, along), beyond: before });
                }
            }
        }
    }
    edges
}

/// Median noise energy beside the borders over that deeper in the tiles: medians, since a few fireflies would
/// decide means.
fn beside(edges: &[Edge], energy: &Plane) -> f64 {
    let median = |place: fn(&Edge) -> usize| -> f64 {
        let mut energies: Vec<f32> =
            edges.iter().map(|e| energy[(place(e) / EDGE, place(e) % EDGE)]).collect();
        energies.sort_by(f32::total_cmp);
        energies.get(energies.len() / 2).map_or(f64::NAN, |&e| f64::from(e))
    };
    median(|e| e.near) / median(|e| e.deep)
}
