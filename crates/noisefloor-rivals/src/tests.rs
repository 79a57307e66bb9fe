//! What holds for every rival.

use crate::testing::{NoisySource, constant, empty, view};
use crate::{RIVALS, parse};
use noisefloor::{Driver, Film, Params, Rgb, Stop, StoppingCriterion, Tile, Verdict};
use noisefloor_testkit::Noise;

/// Every criterion that needs no converged picture, lax enough to come to an end soon.
const SPECS: [&str; 7] = [
    "spp:300",
    "relative-error:0.1",
    "dammertz:0.01",
    "cycles:0.05",
    "luxcore:0.2",
    "vdp-stages:0.9",
    "vdp-first:0.9",
];

/// Drives a picture with noise of `sigma` times its brightness a sample.
fn drive(spec: &str, sigma: f64) -> Vec<Stop> {
    let picture = |x: usize, y: usize| 0.05 + 0.01 * x as f64 + if y > 40 { 0.3 } else { 0.0 };
    let source = NoisySource { edge: 64, picture, sigma };
    let params = Params::default().with_tile(32).with_max_spp(20_000);
    let mut driver = Driver::new(source, parse(spec).unwrap(), params).unwrap();
    driver.run(|_, _| ()).unwrap();
    driver.session().stops().collect()
}

#[test]
fn each_drives_a_source_to_the_end() {
    assert_eq!(SPECS.len(), RIVALS.iter().filter(|rival| !rival.against_converged).count());
    for spec in SPECS {
        let stops = drive(spec, 0.5);
        assert!(stops.len() == 4 && stops.iter().all(|s| s.reason.is_satisfied()), "{spec}: {stops:?}");
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    for spec in SPECS {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| drive(spec, 0.5))
        };
        assert_eq!(run(1), run(3), "{spec}");
    }
}

/// Exchanging the halves changes no verdict to the bit, from call to call, even or uneven.
#[test]
fn exchanged_halves_are_judged_alike() {
    for spec in SPECS {
        let run = |first: usize| {
            let mut criterion = parse(spec).unwrap();
            let mut film = empty();
            criterion.begin(film.grid());
            let mut verdicts: Vec<Verdict> = Vec::new();
            for (round, samples) in [[40, 40], [25, 60], [300, 300]].into_iter().enumerate() {
                // The half with fewer samples is next; once they are uneven, that is one and the same
                for half in if round < 2 { [first, 1 - first] } else { [0, 1] } {
                    for tile in film.grid().tiles() {
                        let mut noise = Noise::keyed(&[round as u64, half as u64, tile.index as u64]);
                        let batch: Vec<Rgb> = (0..tile.pixels())
                            .map(|_| [(0.4 + 0.3 * noise.normal() / (samples[half] as f64).sqrt()) as f32; 3])
                            .collect();
                        film.add(tile.index, samples[half], &batch).unwrap();
                    }
                }
                let tiles: Vec<Tile> = film.grid().tiles().collect();
                verdicts.extend(criterion.judge(&view(&film), &tiles).unwrap());
            }
            verdicts
        };
        assert_eq!(run(0), run(1), "{spec}");
    }
}

#[test]
fn stricter_takes_more() {
    let samples = |spec: &str, sigma| drive(spec, sigma).iter().map(|s| s.spp).sum::<u64>();
    for (strict, lax, sigma) in [
        ("relative-error:0.06", "relative-error:0.2", 0.5),
        ("dammertz:0.002", "dammertz:0.01", 0.5),
        ("cycles:0.02", "cycles:0.1", 0.5),
        ("luxcore:0.02", "luxcore:0.5", 0.5),
        ("vdp-stages:0.3", "vdp-stages:0.99", 4.0),
        ("vdp-first:0.1", "vdp-first:0.99", 4.0),
    ] {
        let (strict_samples, lax_samples) = (samples(strict, sigma), samples(lax, sigma));
        assert!(strict_samples > lax_samples, "{strict}: {strict_samples}, {lax}: {lax_samples}");
    }
}

/// Films at the ends of what there is.
fn extremes() -> Vec<(&'static str, Film)> {
    let speck = |value: f32| {
        let mut film = empty();
        for half in 0..4u8 {
            for tile in film.grid().tiles() {
                let mut batch: Vec<Rgb> = vec![[1e-8; 3]; tile.pixels()];
                batch[5] = if half % 2 == 0 { [value; 3] } else { [0.0; 3] };
                film.add(tile.index, 50, &batch).unwrap();
            }
        }
        film
    };
    vec![
        ("black", constant(0.0, 200)),
        ("bright", constant(1e8, 200)),
        ("faint", constant(1e-30, 200)),
        ("negative", constant(-1.0, 200)),
        ("one bright pixel", speck(1e30)),
        ("one pixel without a sample", speck(f32::NAN)),
        ("empty but for one tile", {
            let mut film = empty();
            film.add(2, 10, &[[0.5; 3]; 1024]).unwrap();
            film
        }),
    ]
}

#[test]
fn extremes_are_judged() {
    for spec in SPECS {
        for (name, film) in extremes() {
            let mut criterion = parse(spec).unwrap();
            let tiles: Vec<Tile> = film.grid().tiles().filter(|t| film.spp(t.index) > 0).collect();
            for _ in 0..3 {
                let verdicts: Vec<Verdict> = criterion.judge(&view(&film), &tiles).unwrap();
                assert_eq!(verdicts.len(), tiles.len(), "{spec}, {name}");
                assert!(verdicts.iter().all(|v| v.probability.is_none() && !v.unfamiliar));
            }
        }
    }
}

#[test]
fn what_is_constant_is_done_soon() {
    // Two looks at a constant picture, and for the growth of differences a third one, with twice the samples
    // each.
    for spec in SPECS {
        let mut criterion = parse(spec).unwrap();
        let mut done = false;
        for samples in [100, 200, 400, 800] {
            let film = constant(0.5, samples);
            let tiles: Vec<Tile> = film.grid().tiles().collect();
            done = criterion.judge(&view(&film), &tiles).unwrap().iter().all(|v| v.converged);
        }
        assert!(done, "{spec}");
    }
}

#[test]
fn copies_go_on_by_themselves() {
    let film = constant(0.5, 200);
    let tiles: Vec<Tile> = film.grid().tiles().collect();
    let mut halt = crate::LuxCoreHalt::new(0.31);
    halt.judge(&view(&film), &tiles).unwrap();
    let mut copy = halt.clone();
    let later = constant(0.5, 400);
    assert!(copy.judge(&view(&later), &tiles).unwrap()[0].converged);
    assert!(format!("{halt:?}").contains("halted: false") && format!("{copy:?}").contains("halted: true"));
}
