//! Sessions that Python and JavaScript replay with the same samples: what the core says of each is in a file.

use noisefloor::{
    Audience, Model, Oracle, Params, People, Request, Rgb, Schedule, Session, ToneMapping, Viewing,
};
use noisefloor_testkit::Noise;
use serde_json::{Value, json};

/// Written anew by `NOISEFLOOR_BLESS=1 cargo test -p noisefloor-tests --test it bindings`.
const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures/sessions.json");

/// A slope of light with stripes in it, and noise of its own strength. The arithmetic is that of IEEE 754, without functions
/// that libraries differ in, so that every language has these samples to the bit.
struct Wall {
    width: usize,
    light: f64,
    noise: f64,
    holes: bool,
}

impl Wall {
    /// The mean of new samples; `batch` counts batches.
    fn batch(&self, &Request { tile, spp, .. }: &Request, batch: u32) -> Vec<Rgb> {
        let number = |i: usize, c: usize| {
            let place = (3 * i + c) as u32;
            let mixed = place.wrapping_mul(0x9e37_79b1).wrapping_add(batch.wrapping_mul(0x85eb_ca77));
            let mixed = (mixed ^ mixed >> 15).wrapping_mul(0x2c1b_3c6d);
            (mixed ^ mixed >> 12) >> 8
        };
        let pixel = |i: usize| -> Rgb {
            let (x, y) = (tile.x + i % tile.width, tile.y + i / tile.width);
            let lit = self.light * (0.2 + x as f64 / self.width as f64);
            let lit = lit * if (x + 2 * y) % 50 < 20 { 0.3 } else { 1.0 };
            if self.holes && number(i, 0).is_multiple_of(499) {
                return [f32::NAN; 3];
            }
            [0, 1, 2].map(|c| {
                let noise = f64::from(number(i, c)) / f64::from(1 << 23) - 1.0;
                (lit * (1.0 + self.noise * noise / (spp as f64).sqrt())).max(0.0) as f32
            })
        };
        (0..tile.pixels()).map(pixel).collect()
    }
}

/// A session of random shape and options, whose requests are answered until it is done: each tile's samples, reason and P
/// after each verdict.
fn session(seed: u64) -> Value {
    let mut noise = Noise::keyed(&[75, seed]);
    let mut between = |low: usize, high: usize| low + noise.below(high - low + 1);
    let size = (between(20, 90), between(20, 90));
    let step = between(2, 40) as u64;
    let schedules = [Schedule::Every { step }, Schedule::Spaced { step }, Schedule::Growing { step }];
    let (tile, schedule, consecutive) = (between(16, 64), schedules[between(0, 2)], between(1, 2) as u32);
    let (min_spp, max_spp) = (between(20, 100) as u64, between(300, 900) as u64);
    // The same in one precision and the other
    let people = [0.5_f32, 0.75, 0.9375][between(0, 2)];
    let (slope, viewing) = ([0.5, 1.0, 2.0][between(0, 2)], ["desk", "phone", "desk,fps=24"][between(0, 2)]);
    let (srgb, running, exposure) = (between(0, 1) == 1, seed % 3 == 1, [0.5_f32, 2.0][between(0, 1)]);
    let mut options = json!({
        "tile": tile, "schedule": schedule.name(), "step": step, "min_spp": min_spp, "max_spp": max_spp,
        "consecutive": consecutive, "viewing": viewing, "audience": [slope, 0.0],
    });
    let mut params = Params::default()
        .with_tile(tile)
        .with_schedule(schedule)
        .with_min_spp(min_spp)
        .with_max_spp(max_spp)
        .with_consecutive(consecutive)
        .with_viewing(viewing.parse::<Viewing>().unwrap())
        .with_audience(Audience { slope, offset: 0.0 });
    if srgb {
        (options["tone_mapping"], options["exposure"]) = ("srgb".into(), exposure.into());
        params = params.with_tone_mapping(ToneMapping::Srgb { exposure });
    }
    let (light, strength) = (between(10, 110) as f64 / 100.0, between(20, 220) as f64 / 100.0);
    let wall = Wall { width: size.0, light, noise: strength, holes: seed % 3 == 2 };

    let oracle = Oracle::new(Model::bundled(), People::new(people).unwrap());
    let mut session = Session::new(size.0, size.1, oracle, params).unwrap();
    let tiles: Vec<_> = session.film().grid().tiles().collect();
    let mut sums: Vec<(u64, Vec<f64>)> = tiles.iter().map(|t| (0, vec![0.0; 3 * t.pixels()])).collect();
    let (mut rounds, mut batch) = (Vec::new(), 0);
    while !session.is_done() {
        for request in session.requests() {
            let (index, spp, mean) = (request.tile.index, request.spp, wall.batch(&request, batch));
            batch += 1;
            let (total, sum) = &mut sums[index];
            *total += spp;
            sum.iter_mut().zip(mean.as_flattened()).for_each(|(s, new)| *s += f64::from(*new) * spp as f64);
            if running {
                let mean: Vec<f32> = sum.iter().map(|sum| (sum / *total as f64) as f32).collect();
                session.push_running(index, *total, mean.as_chunks().0).unwrap();
            } else {
                session.push(index, spp, &mean).unwrap();
            }
        }
        session.judge().unwrap();
        let state = |index: usize| {
            let stop = session.stops().find(|stop| stop.tile.index == index);
            let (spp, reason) = stop.map_or((session.film().spp(index), "open".to_owned()), |stop| {
                (stop.spp, stop.reason.to_string())
            });
            json!([spp, reason, session.verdict(index).and_then(|verdict| verdict.probability)])
        };
        rounds.push((0..tiles.len()).map(state).collect::<Vec<Value>>());
    }
    json!({
        "width": size.0, "height": size.1, "people": people, "params": options, "running": running,
        "light": light, "noise": strength, "holes": wall.holes,
        "warnings": session.warnings().len(), "rounds": rounds,
    })
}

/// Another machine's logarithms may differ, and with them P by 10⁻⁵; no stop of these seeds hangs on so little.
#[test]
fn sessions_are_those_that_bindings_replay() {
    let found: Vec<Value> = (0..12).map(session).collect();
    if std::env::var_os("NOISEFLOOR_BLESS").is_some() {
        let lines: Vec<String> = found.iter().map(Value::to_string).collect();
        std::fs::write(FILE, format!("[{}]\n", lines.join(",\n"))).unwrap();
    }
    let kept: Vec<Value> = serde_json::from_str(&std::fs::read_to_string(FILE).unwrap()).unwrap();
    assert_eq!(found.len(), kept.len());
    for (mut found, mut kept) in found.into_iter().zip(kept) {
        let probabilities = |session: &mut Value| -> Vec<Option<f64>> {
            let rounds = session["rounds"].as_array_mut().unwrap().iter_mut();
            let states = rounds.flat_map(|round| round.as_array_mut().unwrap());
            states.map(|state| state[2].take().as_f64()).collect()
        };
        for (p, q) in probabilities(&mut found).into_iter().zip(probabilities(&mut kept)) {
            assert!(p == q || (p.unwrap() - q.unwrap()).abs() < 1e-5, "{p:?} {q:?}");
        }
        assert_eq!(found, kept);
    }
}
