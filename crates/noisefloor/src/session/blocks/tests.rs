use super::*;
use crate::criterion::{CriterionError, FixedSpp, Needs, Verdict};
use crate::display::ToneMapping;
use crate::film::Film;
use crate::film::FilmError;
use crate::params::{Params, Schedule};
use noisefloor_testkit::Noise;

/// Wants samples where it is bright, which is the surest way to a bias, and ends at a number of samples.
struct Bright(u64);

impl StoppingCriterion for Bright {
    fn name(&self) -> String {
        "bright".into()
    }

    fn fingerprint(&self) -> String {
        self.name()
    }

    fn needs(&self) -> Needs {
        Needs::HALVES
    }

    fn block_needs(&self, view: &View<'_>, tiles: &[Tile], edge: usize) -> Option<Vec<Option<Vec<f64>>>> {
        let (image, width) = (view.film.image(), view.film.grid().width());
        let of_block = |block: Tile| {
            let pixels = block.rows(width).flatten();
            pixels.map(|pixel| f64::from(image[pixel][0])).sum::<f64>() / block.pixels() as f64
        };
        let needs = |&tile: &Tile| Some(crate::blocks::blocks_of(tile, edge).map(of_block).collect());
        Some(tiles.iter().map(needs).collect())
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let verdict = |tile: &Tile| {
            let converged = view.film.spp(tile.index) >= self.0;
            Verdict { converged, expected_spp: Some(self.0), ..Verdict::default() }
        };
        Ok(tiles.iter().map(verdict).collect())
    }
}

fn params(blocks: usize) -> Params {
    let (tone_mapping, schedule) = (ToneMapping::Srgb { exposure: 1.0 }, Schedule::Every { step: 32 });
    Params { tile: 32, blocks, tone_mapping, schedule, min_spp: 0, ..Params::default() }
}

/// Twelve blocks in two tiles, the second with narrow ones.
fn session<C: StoppingCriterion>(criterion: C, blocks: usize) -> Session<C> {
    Session::new(56, 40, criterion, params(blocks)).unwrap()
}

/// How many of `n` samples find a light that one of 1/`chance` finds: binomial, by inversion.
fn found(noise: &mut Noise, n: u64, chance: f64) -> u64 {
    let (u, mut k) = (noise.uniform(), 0);
    let mut probability = (1.0 - chance).powf(n as f64);
    let mut below = probability;
    while u > below && k < n {
        probability *= (n - k) as f64 / (k + 1) as f64 * chance / (1.0 - chance);
        k += 1;
        below += probability;
    }
    k
}

/// What a pixel has found from its sample `first` on, on average: 1 in the long run.
fn rare(keys: [u64; 3], samples: BlockSamples, chance: f64) -> f32 {
    let [seed, tile, pixel] = keys;
    let mut noise = Noise::keyed(&[seed, tile, pixel, samples.first]);
    (found(&mut noise, samples.spp, chance) as f64 / (samples.spp as f64 * chance)) as f32
}

fn mean_of(request: &BlockRequest, seed: u64, chance: f64) -> Vec<Rgb> {
    let pixel = |i: usize| {
        let samples = request.at(i % request.tile.width, i / request.tile.width);
        [rare([seed, request.tile.index as u64, i as u64], samples, chance); 3]
    };
    (0..request.tile.pixels()).map(pixel).collect()
}

/// The mean of a picture, and what it would be if a batch counted in a block by the samples that the block
/// got of it.
fn render(seed: u64, chance: f64) -> (f64, f64) {
    let mut session = Session::new(32, 32, Bright(160), params(16)).unwrap();
    let mut by_counts = vec![(0.0, 0.0); 32 * 32];
    while !session.is_done() {
        for request in session.next_batches() {
            let request = session.block_request(&request).unwrap();
            let mean = mean_of(&request, seed, chance);
            for (i, (sum, count)) in by_counts.iter_mut().enumerate() {
                let samples = request.at(i % 32, i / 32).spp as f64;
                *sum += f64::from(mean[i][0]) * samples;
                *count += samples;
            }
            session.push_blocks(&request, &mean).unwrap();
        }
        if session.is_round_complete() {
            session.judge().unwrap();
        }
    }
    let (least, most) = session.film().spp_range(0);
    assert!(session.film().spp(0) == 160 && least <= 160 && 160 <= most);
    let image = session.film().image();
    let mean = image.iter().map(|p| f64::from(p[0])).sum::<f64>() / image.len() as f64;
    (mean, by_counts.iter().map(|(sum, count)| sum / count).sum::<f64>() / image.len() as f64)
}

/// A light that one sample in a thousand to a million finds, and a criterion that spreads samples by what was
/// found: means of 300 pictures are right, to within 5 standard errors. They are sums over at least 49 finds,
/// so that a correct film fails with p < 1e-5. Weighting each batch by the counts of its block, the usual
/// way, is found out by the same test.
#[test]
fn blocks_that_look_quiet_by_luck_lose_no_light() {
    let z = |values: &[f64]| {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean - 1.0) / (variance / n).sqrt()
    };
    for chance in [1e-3, 1e-4, 1e-5, 1e-6] {
        let (means, by_counts): (Vec<f64>, Vec<f64>) = (0..300).map(|seed| render(seed, chance)).unzip();
        assert!(z(&means).abs() < 5.0, "one in {}: z = {}", 1.0 / chance, z(&means));
        if chance == 1e-4 {
            assert!(z(&by_counts) < -5.0, "the usual way is not found out: z = {}", z(&by_counts));
        }
    }
}

/// Answers whatever is asked for, block by block, in the order of the requests or against it.
fn run<C: StoppingCriterion>(session: &mut Session<C>, backwards: bool) {
    while !session.is_done() {
        let mut requests = session.next_batches();
        if backwards {
            requests.reverse();
        }
        for request in requests {
            let request = session.block_request(&request).unwrap();
            session.push_blocks(&request, &mean_of(&request, 7, 1e-2)).unwrap();
        }
        if session.is_round_complete() {
            session.judge().unwrap();
        }
    }
}

fn counts(film: &Film) -> Vec<[u64; 2]> {
    film.grid().tiles().flat_map(|tile| film.block_counts(tile.index).unwrap()).collect()
}

#[test]
fn halves_are_alike_in_every_block_and_the_order_does_not_matter() {
    let (mut forwards, mut backwards) = (session(Bright(256), 16), session(Bright(256), 16));
    run(&mut forwards, false);
    run(&mut backwards, true);
    let film = forwards.film();
    assert!(counts(film).iter().all(|[a, b]| a == b), "{:?}", counts(film));
    assert!(film.grid().tiles().any(|t| film.spp_range(t.index).0 < film.spp_range(t.index).1));
    assert_eq!(film.image(), backwards.film().image());
    assert_eq!(counts(film), counts(backwards.film()));

    // What is counted is what was taken
    let width = film.grid().width();
    let at = |pixel: usize| film.samples_at(film.grid().index_at(pixel % width, pixel / width), pixel);
    assert_eq!((0..width * 40).map(at).sum::<u64>(), film.total_samples());
    let average = film.total_samples() as f64 / (width * 40) as f64;
    assert!((average - 256.0).abs() < 1.0, "{average}");
}

/// Two tiles, of which only the first has rare light on its left: shares follow, within their limits.
#[test]
fn samples_go_where_they_are_needed() {
    let mut session = session(Bright(256), 16);
    while !session.is_done() {
        for request in session.next_batches() {
            let request = session.block_request(&request).unwrap();
            let left = |i: usize| request.tile.index == 0 && i % request.tile.width < 16;
            let mean: Vec<Rgb> =
                (0..request.tile.pixels()).map(|i| [f32::from(u8::from(left(i))); 3]).collect();
            session.push_blocks(&request, &mean).unwrap();
        }
        if session.is_round_complete() {
            session.judge().unwrap();
        }
    }
    // ¾ and ¼ after smoothing; of the first 32, all had as many
    let share = |share: f64| 32.0 + 2.0 * (256.0 - 32.0) * share;
    let (least, most) = session.film().spp_range(0);
    assert!(
        (least as f64 - share(0.25)).abs() < 8.0 && (most as f64 - share(0.75)).abs() < 8.0,
        "{least} {most}"
    );
    assert_eq!(session.film().spp_range(1), (256, 256));
}

/// With a criterion that does not know what blocks need, samples and bits are those without blocks; and a
/// renderer that ignores blocks gets the same stops as if there were none.
#[test]
fn without_shares_everything_is_as_without_blocks() {
    let (mut blocks, mut plain) = (session(FixedSpp(96), 16), session(FixedSpp(96), 0));
    run(&mut blocks, false);
    let answer = |session: &mut Session<FixedSpp>| {
        assert!(session.next_batches().iter().all(|request| session.block_request(request).is_none()));
        for request in session.next_batches() {
            let Request { tile, first, spp } = request;
            let all = BlockSamples { first, spp };
            let mean: Vec<Rgb> =
                (0..tile.pixels()).map(|i| [rare([7, tile.index as u64, i as u64], all, 1e-2); 3]).collect();
            session.push(tile.index, spp, &mean).unwrap();
        }
        if session.is_round_complete() {
            session.judge().unwrap();
        }
    };
    while !plain.is_done() {
        answer(&mut plain);
    }
    assert_eq!(blocks.film().image(), plain.film().image());
    assert_eq!(blocks.stops().collect::<Vec<_>>(), plain.stops().collect::<Vec<_>>());
    assert_eq!(blocks.film().total_samples(), plain.film().total_samples());

    let mut ignored = session(Bright(96), 16);
    while !ignored.is_done() {
        for request in ignored.requests() {
            ignored.push(request.tile.index, request.spp, &vec![[0.5; 3]; request.tile.pixels()]).unwrap();
        }
        ignored.judge().unwrap();
    }
    assert!(ignored.stops().all(|stop| stop.spp == 96));
    assert!(ignored.film().grid().tiles().all(|tile| ignored.film().spp_range(tile.index) == (96, 96)));
}

/// What is asked for ahead is what will be asked for, in that order, up to the next verdict and no further:
/// it changes the shares, whatever the criterion expects.
#[test]
fn requests_ahead_are_those_to_come() {
    for schedule in [Schedule::Every { step: 32 }, Schedule::Spaced { step: 10 }] {
        let mut session = Session::new(56, 40, Bright(256), Params { schedule, ..params(16) }).unwrap();
        let tiles = 0..session.film().grid().len();
        while !session.is_done() {
            let ahead: Vec<_> = tiles.clone().map(|t| session.block_requests_ahead(t).unwrap()).collect();
            let mut asked = vec![Vec::new(); tiles.len()];
            while !session.is_round_complete() {
                for request in session.next_batches() {
                    let request = session.block_request(&request).unwrap();
                    session.push_blocks(&request, &mean_of(&request, 7, 1e-2)).unwrap();
                    asked[request.tile.index].push(request);
                }
            }
            assert_eq!(ahead, asked, "{schedule:?}");
            session.judge().unwrap();
        }
        let range = |tile| session.film().spp_range(tile);
        assert!(tiles.into_iter().any(|tile| range(tile).0 < range(tile).1), "{schedule:?}");
    }
    assert!(session(Bright(256), 0).block_requests_ahead(0).is_none());
}

#[test]
fn first_shares_come_before_the_first_verdict() {
    let params = Params { schedule: Schedule::Every { step: 100 }, ..params(16) };
    let mut session = Session::new(32, 32, Bright(100), params).unwrap();
    let mut asked = Vec::new();
    while !session.is_done() {
        let request = session.block_request(&session.requests()[0]).unwrap();
        asked.push(request.spp);
        session.push_blocks(&request, &mean_of(&request, 1, 1e-2)).unwrap();
        session.judge().unwrap();
    }
    assert_eq!(asked, [16, 16, 34, 34]);
}

#[test]
fn batches_of_other_blocks_are_refused() {
    let mut session = session(Bright(96), 16);
    let right = session.block_request(&session.requests()[0]).unwrap();
    let mean = vec![[0.5; 3]; right.tile.pixels()];
    let mut wrong =
        vec![BlockRequest { edge: 32, ..right.clone() }, BlockRequest { spp: 0, ..right.clone() }];
    wrong.push(BlockRequest { blocks: right.blocks[1..].to_vec(), ..right.clone() });
    wrong.push(BlockRequest { tile: Tile { x: 1, ..right.tile }, ..right.clone() });
    let mut empty = right.clone();
    empty.blocks[2].spp = 0;
    wrong.push(empty);
    for request in wrong {
        assert_eq!(session.push_blocks(&request, &mean), Err(FilmError::Blocks(0).into()), "{request:?}");
    }
    assert!(matches!(
        session.push_blocks(&right, &mean[1..]),
        Err(SessionError::Film(FilmError::Pixels { .. }))
    ));
    assert_eq!(session.film().total_samples(), 0);
    assert_eq!(session.push_blocks(&right, &mean), Ok(()));
    let mut without = Session::new(56, 40, Bright(96), params(0)).unwrap();
    assert_eq!(without.push_blocks(&right, &mean), Err(FilmError::Blocks(0).into()));
}

/// Where nobody sees noise, there is nothing to spread.
#[cfg(feature = "bundled-model")]
#[test]
fn a_constant_picture_is_sampled_evenly() {
    let mut session = session(crate::Oracle::bundled(), 16);
    while !session.is_done() {
        for request in session.next_batches() {
            let request = session.block_request(&request).unwrap();
            session.push_blocks(&request, &vec![[0.3; 3]; request.tile.pixels()]).unwrap();
        }
        if session.is_round_complete() {
            session.judge().unwrap();
        }
    }
    assert!(counts(session.film()).iter().all(|count| *count == counts(session.film())[0]));
    assert!(session.film().image().iter().flatten().all(|&c| c == 0.3));
}
