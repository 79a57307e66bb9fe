use crate::criterion::{Needs, StoppingCriterion, Verdict};
use crate::film::Film;
use crate::tests::judging_each;
use crate::{FixedSpp, Params, Request, Schedule, Session, Stop};
use proptest::prelude::*;

/// Later tiles need more; keeps halves, and looks at the samples of the whole picture, as the oracle does.
fn neighbours() -> impl StoppingCriterion {
    judging_each(Needs::HALVES, |view, tile| {
        let others = view.film.total_samples() / 1_000_000;
        let enough = 150 * (tile.index as u64 + 1) + others % 50;
        Verdict::new(view.film.spp(tile.index) >= enough).expecting(Some(enough))
    })
}

/// A batch that depends on its request alone, and rounds.
fn sample(request: &Request) -> Vec<[f32; 3]> {
    let value = |pixel: usize| {
        let mixed = (pixel as u64 + 1).wrapping_mul(request.first + 0x9e37_79b9_7f4a_7c15);
        ((mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32 / (1 << 24) as f32
    };
    (0..request.tile.pixels()).map(|pixel| [value(pixel), 0.1, value(pixel) * 3.0]).collect()
}

fn bits(film: &Film) -> Vec<u32> {
    film.image().as_flattened().iter().map(|v| v.to_bits()).collect()
}

/// Renders, choosing what to sample next as `choose` says.
fn render(schedule: Schedule, mut choose: impl FnMut(usize) -> usize) -> (Vec<u32>, Vec<Stop>) {
    let params = Params { tile: 512, schedule, max_spp: 500, ..Params::default() };
    let mut session = Session::new(700, 600, neighbours(), params).unwrap();
    while !session.is_done() {
        let batches = session.next_batches();
        match batches.len() {
            0 => drop(session.judge().unwrap()),
            n => {
                let request = batches[choose(n)];
                session.push(request.tile.index, request.spp, &sample(&request)).unwrap();
            }
        }
    }
    (bits(session.film()), session.stops().collect())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2, ..ProptestConfig::default() })]
    #[test]
    fn film_and_stops_do_not_depend_on_the_order(seed: u64, spaced: bool) {
        let schedule = if spaced { Schedule::Spaced { step: 50 } } else { Schedule::Every { step: 50 } };
        let mut random = noisefloor_testkit::Noise::new(seed);
        prop_assert!(render(schedule, |n| random.below(n)) == render(schedule, |_| 0));
    }
}

/// What is asked for ahead is what will be asked for, in that order, as long as nothing stops.
#[test]
fn batches_ahead_are_those_to_come() {
    let params = Params { tile: 512, min_spp: 100, max_spp: 1000, ..Params::default() };
    let mut session = Session::new(2048, 1024, neighbours(), params).unwrap();
    let mut asked: Vec<Vec<Request>> = vec![Vec::new(); 8];
    let mut ahead = vec![Vec::new(); 8];
    while !session.is_done() {
        for (tile, (ahead, asked)) in ahead.iter_mut().zip(&asked).enumerate() {
            let known: &Vec<Request> = ahead;
            if session.is_open(tile) && known.len() <= asked.len() {
                let mut longer = known.clone();
                longer.extend(session.batches_ahead(tile));
                *ahead = longer;
            }
        }
        for request in session.next_batches() {
            asked[request.tile.index].push(request);
            session.push(request.tile.index, request.spp, &sample(&request)).unwrap();
        }
        if session.is_round_complete() {
            session.judge().unwrap();
        }
    }
    for (ahead, asked) in ahead.iter().zip(&asked) {
        assert!(ahead.starts_with(asked), "{ahead:?} {asked:?}");
    }
    // In a picture of 2 megapixels, batches begin with two samples
    let first: Vec<u64> = asked[0].iter().map(|request| request.spp).take(8).collect();
    assert_eq!(first, [2, 2, 2, 2, 4, 4, 8, 8]);
    assert!(ahead[7].len() >= asked[7].len());
    let rounds = asked[7].iter().map(|request| request.spp).max();
    assert_eq!(rounds, Some(16));
}

#[test]
fn a_count_without_halves_has_batches_too() {
    let params = Params { tile: 64, min_spp: 100, max_spp: 250, ..Params::default() };
    let session = Session::new(64, 64, FixedSpp(250), params).unwrap();
    let batches = session.batches_ahead(0);
    assert_eq!(batches.iter().map(|b| (b.first, b.spp)).collect::<Vec<_>>(), [(0, 104)]);
    assert_eq!(session.next_batches(), batches);
}
