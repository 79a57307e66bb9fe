use super::*;
use crate::criterion::{FixedSpp, Needs};
use crate::params::Schedule;
use crate::tests::{judging, saved};

/// Says "converged" from given samples on, with halves or without.
struct From {
    samples: u64,
    halves: bool,
    asked: Vec<(usize, u64)>,
}

impl StoppingCriterion for From {
    fn name(&self) -> String {
        "from".into()
    }

    fn fingerprint(&self) -> String {
        self.name()
    }

    fn needs(&self) -> Needs {
        Needs { halves: self.halves, reference: false }
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let verdict = |tile: &Tile| {
            let samples = view.film.spp(tile.index);
            self.asked.push((tile.index, samples));
            // Tiles further on need more.
            let enough = self.samples * (tile.index as u64 + 1);
            Verdict {
                converged: samples >= enough,
                probability: Some(0.5),
                expected_spp: Some(enough),
                unfamiliar: tile.index == 1,
                ..Verdict::default()
            }
        };
        Ok(tiles.iter().map(verdict).collect())
    }
}

fn session(samples: u64, halves: bool, params: Params) -> Session<From> {
    Session::new(80, 32, From { samples, halves, asked: vec![] }, Params { tile: 32, ..params }).unwrap()
}

/// Pushes a grey picture as it is asked for, and judges.
fn round<C: StoppingCriterion>(session: &mut Session<C>) -> Result<Vec<Stop>, SessionError> {
    for r in session.requests() {
        assert_eq!(r.first, session.film().spp(r.tile.index));
        session.push(r.tile.index, r.spp, &vec![[0.3; 3]; r.tile.pixels()])?;
    }
    session.judge()
}

fn run(session: &mut Session<From>) -> Vec<(u64, StopReason)> {
    while !session.is_done() {
        round(session).unwrap();
    }
    session.stops().map(|s| (s.spp, s.reason)).collect()
}

/// Verdicts from 100 samples on, in steps of 10.
fn steps_of_10() -> Params {
    Params::default().with_schedule(Schedule::Spaced { step: 10 }).with_min_spp(100)
}

#[test]
fn each_tile_stops_when_it_has_enough() {
    use StopReason::Converged;
    let expected = [(300, Converged), (600, Converged), (900, Converged)];
    let mut s = session(300, true, steps_of_10());
    assert_eq!(run(&mut s), expected);
    assert!(s.stops().map(|stop| stop.unfamiliar).eq([false, true, false]));
    assert_eq!(s.film().half_counts(1), [300, 300]);
    assert_eq!(run(&mut session(300, false, steps_of_10())), expected);
}

#[test]
fn spaced_verdicts_stop_at_the_same_samples_with_fewer_looks() {
    let params = Params { schedule: Schedule::Every { step: 10 }, ..steps_of_10() };
    let (mut every, mut spaced) = (session(2000, true, params), session(2000, true, steps_of_10()));
    assert_eq!(run(&mut every), run(&mut spaced));
    assert!(spaced.criterion.asked.len() * 2 < every.criterion.asked.len());
}

#[test]
fn limits_hold() {
    use StopReason::{Converged, MaxSpp};
    let params = Params { min_spp: 400, max_spp: 750, ..steps_of_10() };
    assert_eq!(run(&mut session(300, true, params)), [(400, Converged), (600, Converged), (750, MaxSpp)]);
}

#[test]
fn one_verdict_is_not_a_streak() {
    let params = Params { consecutive: 3, ..steps_of_10() };
    // Each time a quarter more, in steps of 10
    assert_eq!(run(&mut session(300, true, params.clone())).map_samples(), [460, 930, 1400]);
    let params = Params { schedule: Schedule::Every { step: 100 }, ..params };
    assert_eq!(run(&mut session(300, true, params)).map_samples(), [500, 800, 1100]);
}

#[test]
fn a_demanding_audience_gets_more() {
    let params =
        Params { audience: Audience { slope: 1.94, offset: -346.0 }, max_spp: 1200, ..steps_of_10() };
    // 1.94·300 − 346 = 236 → 300; 1.94·600 − 346 = 818; 1.94·900 − 346 = 1400 → the limit.
    let mut s = session(300, true, params);
    let stops = run(&mut s);
    assert_eq!(stops.map_samples(), [300, 818, 1200]);
    assert_eq!(stops[2].1, StopReason::MaxSpp);
    assert!(s.criterion.asked.iter().all(|&(_, n)| n <= 900), "no more verdicts once converged");
}

#[test]
fn a_less_demanding_audience_gets_less() {
    let audience = Audience { slope: 0.5, offset: 0.0 };
    let mut s = session(300, true, Params { audience, ..steps_of_10() });
    // Half of 300, 600 and 900, and no verdict on the way beyond
    assert_eq!(run(&mut s).map_samples(), [150, 300, 450]);
}

/// Tile 0 waits for what a demanding audience wants, and has it when the verdict on the others fails.
#[test]
fn a_stop_is_filed_only_if_it_is_returned() {
    let audience = Audience { slope: 1.1, offset: 0.0 };
    let params = Params { tile: 32, audience, ..steps_of_10() };
    let mut calls = 0;
    let moody = judging(Needs::default(), move |view, tiles| {
        calls += 1;
        if calls == 2 {
            return Err(CriterionError::NoReference("moody".into()));
        }
        Ok(tiles.iter().map(|tile| Verdict::new(tile.index == 0 || view.film.spp(0) > 200)).collect())
    });
    let mut s = Session::new(70, 32, moody, params).unwrap();
    assert_eq!(round(&mut s), Ok(Vec::new()));
    assert!(matches!(round(&mut s), Err(SessionError::Criterion(_))));
    assert_eq!(s.stops().count(), 0);
    assert_eq!(s.judge().unwrap().len(), 1);
}

#[test]
fn whole_images_are_pushed_to_open_tiles() {
    let mut s = session(100, true, steps_of_10());
    let image: Vec<Rgb> = (0..80 * 32).map(|i| [0.1 + i as f32 / 1e4; 3]).collect();
    s.push_image(50, &image).unwrap();
    s.push_image(50, &image).unwrap();
    assert_eq!(s.film().image(), image);
    assert_eq!(s.judge().unwrap().len(), 1);
    s.push_image(50, &image).unwrap();
    assert_eq!([0, 1, 2].map(|tile| s.film().spp(tile)), [100, 150, 150]);
    let wrong = s.push_image(50, &image[1..]);
    assert_eq!(wrong, Err(SessionError::Image { got: 80 * 32 - 1, expected: 80 * 32 }));
}

/// What a `main` that returns a `Result` prints.
#[test]
fn errors_are_debugged_as_what_to_do() {
    let error = SessionError::Fault(Fault::Running { correlation: 0.5 });
    assert!(format!("{error:?}").contains("push means of new samples only"), "{error:?}");
    let error = crate::DriverError::from(error);
    assert!(format!("{error:?}").contains("push means of new samples only"), "{error:?}");
}

#[test]
fn warnings_are_handed_over_once() {
    let mut s = session(1000, true, steps_of_10());
    for _ in 0..2 {
        s.push_image(50, &[[0.3; 3]; 80 * 32]).unwrap();
    }
    s.judge().unwrap();
    assert_eq!(s.new_warnings(), [Warning::Constant([0.3; 3])]);
    assert_eq!((s.new_warnings(), s.warnings().len()), (Vec::new(), 1));
}

#[test]
fn nothing_is_judged_before_every_tile_has_samples() {
    let mut s = session(100, true, steps_of_10());
    for _ in 0..2 {
        s.push(0, 50, &[[0.3; 3]; 32 * 32]).unwrap();
    }
    assert_eq!(s.judge().unwrap(), []);
    assert!(s.display().is_none());
    s.set_display(Display::SRGB).unwrap();
    assert_eq!(s.judge().unwrap().len(), 1);
}

#[test]
fn closing_keeps_what_is_done() {
    let mut s = session(100, true, steps_of_10());
    assert_eq!([0, 1].map(|_| round(&mut s).unwrap().len()), [0, 1]);
    assert_eq!(s.close_all(Interruption::TimeLimit).len(), 2);
    let reasons: Vec<_> = s.stops().map(|s| s.reason).collect();
    assert_eq!(reasons, [StopReason::Converged, StopReason::TimeLimit, StopReason::TimeLimit]);
    assert!(s.requests().is_empty());
}

#[test]
fn bad_input_is_an_error() {
    let new =
        |w, h, tile| Session::new(w, h, crate::FixedSpp(1), Params { tile, ..steps_of_10() }).map(|_| ());
    assert!(matches!(new(0, 10, 32), Err(SessionError::Tile(_))));
    assert!(matches!(new(10, 10, 0), Err(SessionError::Tile(_))));
    let mut s = session(100, true, steps_of_10());
    let reference = Reference { width: 80, height: 32, pixels: vec![] };
    assert!(matches!(s.set_reference(reference), Err(SessionError::Reference { .. })));
    assert!(s.push(9, 1, &[]).is_err());
}

trait MapSamples {
    fn map_samples(&self) -> Vec<u64>;
}

impl MapSamples for Vec<(u64, StopReason)> {
    fn map_samples(&self) -> Vec<u64> {
        self.iter().map(|s| s.0).collect()
    }
}

/// An image pushed as a whole, with any number of threads, is its tiles pushed one by one: film, counts of what was
/// left out, and all that was noticed.
#[test]
fn images_are_tiles_one_by_one_whatever_the_threads() {
    let (width, height) = (150, 83);
    let image = |k: u64| -> Vec<Rgb> {
        let mut noise = noisefloor_testkit::Noise::keyed(&[63, k]);
        let mut number = || (0.3 + 0.4 * noise.normal()) as f32;
        let mut image: Vec<Rgb> = (0..width * height).map(|_| [number(), number(), number()]).collect();
        // Lost now in one half, now in the other
        (0..40).for_each(|i| image[(i * 311 + 97 * k as usize) % (width * height)][1] = f32::INFINITY);
        image
    };
    let new = || {
        let params = Params::default().with_tile(32).with_max_spp(1000);
        let mut session = Session::new(width, height, crate::Oracle::bundled(), params).unwrap();
        for tile in [0, 3, 7] {
            session.close(tile, Interruption::Cancelled);
        }
        session
    };
    let all = |session: &Session<crate::Oracle>| {
        (saved(session), session.film().rejected(), session.negative_samples())
    };
    let batches = || (0..9).map(|k| ([8, 8, 5, 16, 40][k % 5], image(k as u64)));
    let mut one_by_one = new();
    for (spp, image) in batches() {
        for tile in one_by_one.film().grid().tiles().filter(|tile| ![0, 3, 7].contains(&tile.index)) {
            let mean: Vec<Rgb> = tile.rows(width).flat_map(|row| image[row].to_vec()).collect();
            one_by_one.push(tile.index, spp, &mean).unwrap();
        }
    }
    assert!(one_by_one.film().rejected() > 0 && one_by_one.negative_samples() > 0);
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut whole = new();
        batches().for_each(|(spp, image)| pool.install(|| whole.push_image(spp, &image)).unwrap());
        assert!(all(&whole) == all(&one_by_one), "{threads} threads");
    }
}

/// Tiles before the one that is refused have the samples, as if they had been pushed one by one.
#[test]
fn an_image_is_pushed_up_to_the_tile_that_is_refused() {
    let mut session = Session::new(64, 32, crate::FixedSpp(100), Params::default().with_tile(16)).unwrap();
    let mut image = vec![[0.5; 3]; 64 * 32];
    let tile = session.film().grid().tile(5);
    tile.rows(64).for_each(|row| image[row].fill([f32::NAN; 3]));
    let fault = session.push_image(8, &image).unwrap_err();
    assert!(matches!(fault, SessionError::Fault(Fault::Light { tile: 5, .. })), "{fault}");
    let spp: Vec<u64> = (0..8).map(|tile| session.film().spp(tile)).collect();
    assert_eq!(spp, [8, 8, 8, 8, 8, 0, 0, 0]);
    let none = session.push_image(0, &vec![[0.5; 3]; 64 * 32]).unwrap_err();
    assert!(matches!(none, SessionError::Film(FilmError::NothingNew { tile: 0, .. })), "{none}");
}

/// A running mean of the whole picture is that of each of its tiles; finished tiles keep what they have.
#[test]
fn running_means_of_pictures_are_those_of_tiles() {
    let params = || Params::default().with_tile(32);
    let mut sessions = [(); 2].map(|()| Session::new(80, 32, FixedSpp(50), params()).unwrap());
    let picture = |level: f32| -> Vec<Rgb> { (0..80 * 32).map(|i| [level + i as f32; 3]).collect() };
    let [whole, tiles] = &mut sessions;
    whole.close(1, Interruption::Cancelled);
    tiles.close(1, Interruption::Cancelled);
    for (total, level) in [(3, 1.0), (8, 2.0)] {
        let image = picture(level);
        whole.push_running_image(total, &image).unwrap();
        for tile in tiles.film().grid().tiles().filter(|tile| tile.index != 1) {
            let mean: Vec<Rgb> = tile.rows(80).flat_map(|row| &image[row]).copied().collect();
            tiles.push_running(tile.index, total, &mean).unwrap();
        }
    }
    assert_eq!(whole.film().image(), tiles.film().image());
    assert_eq!((whole.film().spp(0), whole.film().spp(1)), (8, 0));
    assert!(matches!(whole.push_running_image(9, &picture(1.0)[1..]), Err(SessionError::Image { .. })));
    assert!(matches!(whole.push_running_image(8, &picture(1.0)), Err(SessionError::Film(_))));
}

/// All tiles but the last are satisfied at first, and opened again after that.
struct Opens(Vec<(Tile, Verdict)>);

impl StoppingCriterion for Opens {
    fn name(&self) -> String {
        "opens".into()
    }

    fn fingerprint(&self) -> String {
        self.name()
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let grid = view.film.grid();
        if tiles.len() == 1 {
            let others = grid.tiles().filter(|tile| tile.index != tiles[0].index);
            self.0 = others.map(|tile| (tile, Verdict::new(false).expecting(Some(40)))).collect();
        }
        Ok(tiles.iter().map(|tile| Verdict::new(tile.index + 1 < grid.len())).collect())
    }

    fn revised(&mut self) -> Vec<(Tile, Verdict)> {
        std::mem::take(&mut self.0)
    }
}

/// A verdict on few tiles is dear, so that a few that are open take twice as many samples before the next; many that are opened
/// again are not few.
#[test]
fn many_tiles_that_are_opened_again_take_no_larger_steps_than_many_that_are_open() {
    let params =
        Params::default().with_tile(16).with_min_spp(32).with_schedule(Schedule::Growing { step: 16 });
    let mut session = Session::new(160, 16, Opens(vec![]), params).unwrap();
    (0..2).for_each(|_| drop(round(&mut session).unwrap()));
    assert_eq!(session.open_tiles(), 10);
    let goals: Vec<u64> = session.requests().iter().map(|request| request.first + request.spp).collect();
    assert_eq!(goals[..9], [48; 9]);
}
