use super::*;
use crate::checkpoint::Checkpoint;
use crate::criterion::{CriterionError, FixedSpp, Needs, Verdict, View};
use crate::params::{Params, Schedule};
use crate::tests::{judging, saved};
use crate::watch::Fault;
use noisefloor_testkit::Noise;
use proptest::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

/// A pass of a renderer: an image, or its tiles one by one, in two batches.
struct Handed {
    by_tile: bool,
    spp: [u64; 2],
    images: [Vec<Rgb>; 2],
}

/// Passes over a picture whose noise grows from tile to tile.
fn passes(grid: TileGrid, seed: u64, count: usize) -> Vec<Handed> {
    let mut noise = Noise::keyed(&[63, seed]);
    let mut handed = |_| {
        let spp = [0, 1].map(|_| 4 + noise.below(12) as u64);
        let images = spp.map(|spp| {
            let mut image = vec![[0.0; 3]; grid.width() * grid.height()];
            for tile in grid.tiles() {
                let sigma = 0.02 * 4f64.powi((tile.index % 4) as i32) / (spp as f64).sqrt();
                for pixel in tile.rows(grid.width()).flatten() {
                    image[pixel] = [0.4, 0.5, 0.3].map(|mean| (mean * (1.0 + sigma * noise.normal())) as f32);
                }
            }
            image
        });
        Handed { by_tile: noise.below(2) == 0, spp, images }
    };
    (0..count).map(&mut handed).collect()
}

/// The session that waits, which gives open tiles what they get here.
fn waiting<C: StoppingCriterion>(session: &mut Session<C>, passes: &[Handed]) -> Vec<Stop> {
    let mut stops = Vec::new();
    for Handed { spp, images, .. } in passes {
        for (spp, image) in spp.iter().zip(images) {
            session.push_image(*spp, image).unwrap();
        }
        stops.extend(session.judge().unwrap());
    }
    stops
}

fn hand_over<C: StoppingCriterion + Send + 'static>(background: &Background<C>, passes: &[Handed]) {
    let grid = background.grid;
    for Handed { by_tile, spp, images } in passes {
        for (spp, image) in spp.iter().zip(images) {
            if *by_tile {
                grid.tiles().for_each(|tile| {
                    let mean = tile.rows(grid.width()).flat_map(|row| image[row].to_vec()).collect();
                    background.push(tile.index, *spp, mean).unwrap();
                });
            } else {
                let mut buffer = background.buffer();
                buffer.copy_from_slice(image);
                background.push_image(*spp, buffer).unwrap();
            }
        }
        background.judge().unwrap();
    }
}

fn fresh(grid: TileGrid) -> Session<crate::Oracle> {
    let schedule = Schedule::Growing { step: 8 };
    let params = Params::default().with_tile(grid.edge()).with_schedule(schedule).with_max_spp(400);
    Session::new(grid.width(), grid.height(), crate::Oracle::bundled(), params).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Stops, warnings and all that a checkpoint holds are those of the session that waits; samples of tiles that
    /// had stopped are in the picture, too.
    #[test]
    fn stops_are_those_of_the_session_that_waits(
        width in 16usize..70,
        height in 16usize..70,
        places in 1usize..4,
        seed in 0u64..1000,
    ) {
        let grid = TileGrid::new(width, height, 16).unwrap();
        let passes = passes(grid, seed, 14);
        let mut plain = fresh(grid);
        let stops = waiting(&mut plain, &passes);

        let background = Background::new(fresh(grid), places, WhenFull::Wait).unwrap();
        hand_over(&background, &passes);
        let news = background.finish().unwrap();
        prop_assert_eq!((news.judged, &news.stops), (passes.len(), &stops));
        prop_assert_eq!(&news.warnings, &plain.new_warnings());
        prop_assert_eq!(background.is_done(), plain.is_done());
        prop_assert_eq!(background.next_pass(), plain.next_pass());
        prop_assert!(background.look(saved).unwrap() == saved(&plain));

        let session = background.into_session().unwrap();
        prop_assert!(session.stops().eq(plain.stops()));
        // Half A and half B of the first tile, whose stop, if any, was the first
        let all: u64 = passes.iter().flat_map(|pass| pass.spp).sum();
        let batches = || passes.iter().flat_map(|pass| pass.spp.into_iter().zip(&pass.images));
        for tile in grid.tiles() {
            prop_assert_eq!(session.film().spp(tile.index), all);
            let pixel = tile.y * width + tile.x;
            let sum: f64 = batches().map(|(spp, image)| spp as f64 * f64::from(image[pixel][1])).sum();
            let mean = f64::from(session.film().pixel(tile.index, pixel)[1]);
            // Some roundings of f32
            prop_assert!((mean * all as f64 / sum - 1.0).abs() < 1e-6, "{mean} of {}", sum / all as f64);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Running means of the picture do as those given to the session that waits, also where a tile is opened again that
    /// had stopped; the picture is the last of them.
    #[test]
    fn running_means_do_as_in_the_session_that_waits(
        width in 33usize..70,
        height in 16usize..70,
        places in 1usize..4,
        seed in 0u64..1000,
    ) {
        let grid = TileGrid::new(width, height, 16).unwrap();
        let (mut total, mut sums) = (0, vec![[0.0f64; 3]; width * height]);
        let mut totals = Vec::new();
        for Handed { spp, images, .. } in &passes(grid, seed, 14) {
            for (spp, image) in spp.iter().zip(images) {
                total += spp;
                let all = sums.as_flattened_mut().iter_mut().zip(image.as_flattened());
                all.for_each(|(sum, &mean)| *sum += *spp as f64 * f64::from(mean));
            }
            let mean = |sum: &[f64; 3]| sum.map(|sum| (sum / total as f64) as f32);
            totals.push((total, sums.iter().map(mean).collect::<Vec<Rgb>>()));
        }
        let session = || {
            let schedule = Schedule::Growing { step: 8 };
            let params = Params::default().with_tile(16).with_schedule(schedule).with_max_spp(400);
            Session::new(width, height, Reopens::default(), params).unwrap()
        };
        let mut plain = session();
        let mut stops = Vec::new();
        for (total, image) in &totals {
            plain.push_running_image(*total, image).unwrap();
            stops.extend(plain.judge().unwrap());
        }
        let background = Background::new(session(), places, WhenFull::Wait).unwrap();
        for (total, image) in &totals {
            let mut buffer = background.buffer();
            buffer.copy_from_slice(image);
            background.push_running_image(*total, buffer).unwrap();
            background.judge().unwrap();
        }
        // Some are opened again
        prop_assert!(stops.len() > grid.len());
        prop_assert_eq!(&background.finish().unwrap().stops, &stops);
        let session = background.into_session().unwrap();
        prop_assert!(session.stops().eq(plain.stops()));
        let (total, last) = totals.last().unwrap();
        for tile in grid.tiles() {
            prop_assert_eq!(session.film().spp(tile.index), *total);
        }
        for (of_film, last) in session.film().image().as_flattened().iter().zip(last.as_flattened()) {
            // Roundings of f32, of which the last batch has that of the total times total/new ≤ 60
            prop_assert!((of_film / last - 1.0).abs() < 1e-5, "{of_film} {last}");
        }
    }
}

#[test]
fn a_session_that_was_given_back_goes_on() {
    let grid = TileGrid::new(48, 32, 16).unwrap();
    let passes = passes(grid, 7, 12);
    let mut plain = fresh(grid);
    waiting(&mut plain, &passes);
    let background = Background::new(fresh(grid), 1, WhenFull::Wait).unwrap();
    hand_over(&background, &passes[..4]);
    background.finish().unwrap();
    let kept = background.look(saved).unwrap();
    drop(background);
    let resumed = fresh(grid).resume("job", Checkpoint::read(&kept[..]).unwrap()).unwrap();
    let background = Background::new(resumed, 3, WhenFull::Wait).unwrap();
    hand_over(&background, &passes[4..]);
    background.finish().unwrap();
    assert!(background.look(saved).unwrap() == saved(&plain));
}

/// Converged after 60 samples, and the first tile after 150, with which all others are opened again, once.
#[derive(Default)]
struct Reopens {
    calls: usize,
    done: Vec<Tile>,
}

impl StoppingCriterion for Reopens {
    fn name(&self) -> String {
        "reopens".into()
    }

    fn fingerprint(&self) -> String {
        self.name()
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let enough = |tile: &Tile| view.film.spp(tile.index) >= if tile.index == 0 { 150 } else { 60 };
        self.calls += usize::from(!self.done.is_empty());
        self.done.extend(tiles.iter().copied().filter(|tile| tile.index > 0 && enough(tile)));
        Ok(tiles.iter().map(|tile| Verdict::new(enough(tile))).collect())
    }

    fn revised(&mut self) -> Vec<(Tile, Verdict)> {
        let all = if self.calls == 1 { std::mem::take(&mut self.done) } else { Vec::new() };
        all.into_iter().map(|tile| (tile, Verdict::new(false).expecting(Some(120)))).collect()
    }
}

/// Converged after so many samples; `call` is called at each verdict.
fn calls(enough: u64, mut call: impl FnMut() + Send + 'static) -> impl StoppingCriterion + Send + 'static {
    judging(Needs::default(), move |view, tiles| {
        call();
        Ok(tiles.iter().map(|tile| Verdict::new(view.film.spp(tile.index) >= enough)).collect())
    })
}

fn of_calls(call: impl FnMut() + Send + 'static) -> Session<impl StoppingCriterion + Send + 'static> {
    let params = Params::default().with_tile(16).with_max_spp(1 << 20);
    Session::new(32, 16, calls(100, call), params).unwrap()
}

fn grey<C: StoppingCriterion + Send + 'static>(background: &Background<C>) -> Result<(), SessionError> {
    let mut image = background.buffer();
    image.fill([0.5; 3]);
    background.push_image(16, image)?;
    background.judge()
}

#[test]
fn a_criterion_that_panics_is_an_error_everywhere() {
    for when_full in [WhenFull::Wait, WhenFull::Merge] {
        let session = of_calls(|| panic!("no verdict today"));
        let background = Background::new(session, 1, when_full).unwrap();
        // Some may be handed over before it panics; none hangs
        let failed = (0..1000).find_map(|_| grey(&background).err().or_else(|| background.finish().err()));
        let said = "judging in the background failed: the criterion panicked: no verdict today";
        assert_eq!(failed.unwrap().to_string(), said);
        assert_eq!(background.news().unwrap_err().to_string(), said);
        assert_eq!(grey(&background).unwrap_err().to_string(), said);
        assert_eq!(background.look(|_| ()).unwrap_err().to_string(), said);
        assert_eq!(background.into_session().err().map(|error| error.to_string()).as_deref(), Some(said));
        let background = Background::new(of_calls(|| panic!("again")), 1, when_full).unwrap();
        drop(grey(&background));
        drop(background);
    }
}

#[test]
fn faults_come_later_and_the_session_comes_back() {
    let background = Background::new(of_calls(|| ()), 1, WhenFull::Wait).unwrap();
    grey(&background).unwrap();
    background.finish().unwrap();
    background.push_image(16, vec![[f32::NAN; 3]; 32 * 16]).unwrap();
    background.judge().unwrap();
    let fault = background.finish().unwrap_err();
    assert!(matches!(fault, SessionError::Fault(Fault::Light { tile: 0, .. })), "{fault}");
    assert!(background.judge().is_err_and(|error| error == fault));
    assert_eq!(background.into_session().unwrap().film().spp(0), 16);
}

/// Of samples that came after their tile had stopped, those of other light are left out, of all tiles or of one.
#[test]
fn late_samples_of_other_light_are_left_out() {
    let grid = TileGrid::new(64, 64, 32).unwrap();
    let image = |pass: u64, late: f32| -> Vec<Rgb> {
        let mut noise = Noise::keyed(&[64, pass]);
        (0..64 * 64).map(|_| [(0.4 + 0.1 * noise.normal()) as f32 * late; 3]).collect()
    };
    // A lamp that few samples find is none
    let rare = |pass: u64| {
        let mut image = image(pass, 1.0);
        image[7] = [1e4; 3];
        image
    };
    let finished = |late: &dyn Fn(u64) -> Vec<Rgb>, running: bool| {
        let session =
            Session::new(64, 64, crate::Oracle::bundled(), fresh(grid).params().clone().with_max_spp(32));
        let background = Background::new(session.unwrap(), 2, WhenFull::Wait).unwrap();
        let mut sum = vec![[0.0; 3]; 64 * 64];
        for pass in 0..6 {
            let image = if pass < 2 { image(pass, 1.0) } else { late(pass) };
            sum.as_flattened_mut().iter_mut().zip(image.as_flattened()).for_each(|(sum, new)| *sum += new);
            if running {
                let mean = sum.iter().map(|pixel| pixel.map(|c| c / (pass + 1) as f32)).collect();
                background.push_running_image(16 * (pass + 1), mean).unwrap();
            } else {
                background.push_image(16, image).unwrap();
            }
            background.judge().unwrap();
        }
        let news = background.finish().unwrap();
        assert!(background.is_done() && news.stops.len() == 4, "{news:?}");
        let session = background.into_session().unwrap();
        let late = session.warnings().iter().find(|warning| matches!(warning, Warning::Late { .. })).copied();
        (grid.tiles().map(|tile| session.film().spp(tile.index)).collect::<Vec<_>>(), late)
    };
    let right = (vec![96; 4], None);
    let left_out = (vec![32; 4], Some(Warning::Late { tiles: 4, of: 4 }));
    for running in [false, true] {
        assert_eq!(finished(&|pass| image(pass, 1.0), running), right);
        assert_eq!(finished(&rare, running), right);
        for other in [-5.0, 0.8, 1.2, 1e20] {
            assert_eq!(finished(&|pass| image(pass, other), running), left_out, "{other} {running}");
        }
        let (spp, late) = finished(
            &|pass| {
                let mut image = image(pass, 1.0);
                image[..64 * 32].iter_mut().step_by(64).flatten().for_each(|c| *c += 9.0);
                image[..32].fill([9.0; 3]);
                image
            },
            running,
        );
        assert_eq!((spp, late), (vec![32, 96, 96, 96], Some(Warning::Late { tiles: 1, of: 4 })));
    }
}

#[test]
fn what_does_not_fit_is_refused_at_once() {
    let background = Background::new(of_calls(|| ()), 1, WhenFull::Wait).unwrap();
    assert!(matches!(background.push_image(1, vec![]), Err(SessionError::Image { got: 0, expected: 512 })));
    assert!(matches!(background.push(2, 1, vec![]), Err(SessionError::Film(FilmError::Tile(2, 2)))));
    let short = background.push(1, 1, vec![[0.0; 3]; 3]);
    assert!(matches!(short, Err(SessionError::Film(FilmError::Pixels { got: 3, expected: 256, .. }))));
    background.push_image(0, background.buffer()).unwrap();
    background.judge().unwrap();
    assert!(matches!(background.finish(), Err(SessionError::Film(FilmError::NothingNew { .. }))));
}

/// A criterion that waits until it may go on.
fn gate() -> (Arc<AtomicBool>, Session<impl StoppingCriterion + Send + 'static>) {
    let open = Arc::new(AtomicBool::new(false));
    let of_criterion = Arc::clone(&open);
    let wait = move || {
        while !of_criterion.load(Ordering::Acquire) {
            thread::sleep(Duration::from_millis(1));
        }
    };
    (open, of_calls(wait))
}

#[test]
#[expect(clippy::disallowed_methods, reason = "the renderer's own thread")]
fn a_renderer_waits_for_room() {
    let (open, session) = gate();
    let background = Background::new(session, 2, WhenFull::Wait).unwrap();
    let handed = AtomicUsize::new(0);
    thread::scope(|scope| {
        scope.spawn(|| {
            for _ in 0..6 {
                grey(&background).unwrap();
                handed.fetch_add(1, Ordering::AcqRel);
            }
        });
        // One that is being judged, and two that wait: the first verdict is due after two passes
        while handed.load(Ordering::Acquire) < 3 {
            thread::sleep(Duration::from_millis(1));
        }
        thread::sleep(Duration::from_millis(30));
        let most = handed.load(Ordering::Acquire);
        assert!(most <= 4 && background.pending() == 3, "{most}");
        open.store(true, Ordering::Release);
    });
    assert_eq!(background.finish().unwrap().judged, 6);
    assert_eq!(background.pending(), 0);
}

#[test]
fn passes_that_find_no_room_are_added_to_the_last() {
    let (open, session) = gate();
    let background = Background::new(session, 1, WhenFull::Merge).unwrap();
    for k in 0..9 {
        background.push_image(10 + k, vec![[k as f32; 3]; 32 * 16]).unwrap();
        background.push(1, 1, vec![[100.0; 3]; 16 * 16]).unwrap();
        background.judge().unwrap();
    }
    open.store(true, Ordering::Release);
    let news = background.finish().unwrap();
    assert!((1..9).contains(&news.judged), "{}", news.judged);
    let session = background.into_session().unwrap();
    let film = session.film();
    assert_eq!([film.spp(0), film.spp(1)], [126, 135]);
    let mean = (0..9).map(|k| f64::from(k * (10 + k))).sum::<f64>() / 126.0;
    assert!((f64::from(film.pixel(0, 0)[0]) / mean - 1.0).abs() < 1e-6);
    assert!((f64::from(film.pixel(1, 16)[0]) / ((mean * 126.0 + 900.0) / 135.0) - 1.0).abs() < 1e-6);
}

/// The last of several running means has all samples.
#[test]
fn running_means_that_find_no_room_are_replaced_by_the_next() {
    let (open, session) = gate();
    let background = Background::new(session, 1, WhenFull::Merge).unwrap();
    for k in 1..10 {
        background.push_running_image(20 * k, vec![[k as f32; 3]; 32 * 16]).unwrap();
        background.judge().unwrap();
    }
    open.store(true, Ordering::Release);
    assert!((1..9).contains(&background.finish().unwrap().judged));
    let session = background.into_session().unwrap();
    assert_eq!([session.film().spp(0), session.film().spp(1)], [180, 180]);
    assert!(session.film().image().iter().all(|pixel| (pixel[0] - 9.0).abs() < 1e-4));
    let background = Background::new(of_calls(|| ()), 1, WhenFull::Wait).unwrap();
    assert!(matches!(background.push_running_image(1, vec![]), Err(SessionError::Image { .. })));
    background.push_running_image(16, vec![[0.5; 3]; 32 * 16]).unwrap();
    background.push_running_image(16, vec![[0.5; 3]; 32 * 16]).unwrap();
    background.judge().unwrap();
    assert!(matches!(background.finish(), Err(SessionError::Film(FilmError::NothingNew { .. }))));
}

#[test]
fn dropping_ends_the_thread() {
    let (open, session) = gate();
    let background = Background::new(session, 8, WhenFull::Wait).unwrap();
    (0..8).for_each(|_| grey(&background).unwrap());
    let shared = Arc::downgrade(&background.shared);
    open.store(true, Ordering::Release);
    drop(background);
    assert!(shared.upgrade().is_none());
}

/// What is parallel runs where the embedder wants it.
#[test]
fn work_goes_to_the_pool_of_the_embedder() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    let threads = Arc::new(AtomicUsize::new(0));
    let of_criterion = Arc::clone(&threads);
    let count = move || {
        let inside = rayon::current_thread_index().is_some();
        of_criterion.store(10 * rayon::current_num_threads() + usize::from(inside), Ordering::Release);
    };
    let background =
        Background::new_in(of_calls(count), 1, WhenFull::Wait, move |work| pool.install(work)).unwrap();
    (0..2).for_each(|_| grey(&background).unwrap());
    background.finish().unwrap();
    assert_eq!(threads.load(Ordering::Acquire), 31);
    // And work that never runs is no pass that hangs
    let session = Session::new(32, 16, FixedSpp(8), Params::default().with_tile(16)).unwrap();
    let background = Background::new_in(session, 1, WhenFull::Wait, |_| ()).unwrap();
    drop(grey(&background));
    assert!(matches!(background.finish(), Err(SessionError::Background(_))));
}

#[test]
fn what_is_left_counts_all_that_was_handed_over() {
    let (open, session) = gate();
    let background = Background::new(session, 3, WhenFull::Wait).unwrap();
    let limit = 1 << 20;
    let image = || vec![[0.5; 3]; 32 * 16];
    assert_eq!(background.spp_left(), limit);
    background.push_image(100, image()).unwrap();
    // Not handed over yet
    assert_eq!(background.spp_left(), limit);
    background.push(1, 50, vec![[0.5; 3]; 16 * 16]).unwrap();
    background.judge().unwrap();
    assert_eq!(background.spp_left(), limit - 100, "of the tile that has fewer");
    background.push(0, 70, vec![[0.5; 3]; 16 * 16]).unwrap();
    background.judge().unwrap();
    assert_eq!(background.spp_left(), limit - 150);
    background.push_running_image(160, image()).unwrap();
    background.judge().unwrap();
    assert_eq!(background.spp_left(), limit - 160);
    background.push_image(limit, image()).unwrap();
    background.judge().unwrap();
    assert_eq!(background.spp_left(), 0);
    open.store(true, Ordering::Release);
    drop(background.finish());
}

/// A pass that has all samples leaves one half empty, so that no verdict can come of it: a renderer is not kept waiting.
#[test]
fn one_pass_with_all_samples_is_not_the_end() {
    let session = fresh(TileGrid::new(32, 16, 16).unwrap());
    let background = Background::new(session, 1, WhenFull::Wait).unwrap();
    background.push_image(400, vec![[0.5; 3]; 32 * 16]).unwrap();
    background.judge().unwrap();
    background.finish().unwrap();
    assert_eq!((background.next_pass(), background.spp_left()), (Some(1), 1));
    background.push_image(1, vec![[0.5; 3]; 32 * 16]).unwrap();
    background.judge().unwrap();
    assert_eq!(background.finish().unwrap().stops.len(), 2);
    assert_eq!((background.next_pass(), background.spp_left()), (None, 0));
}

/// Who gives the session back while another thread renders gets it, and that thread an error, though a pass waits behind each
/// verdict.
#[test]
#[expect(clippy::disallowed_methods, reason = "the renderer's own thread")]
fn a_session_is_given_back_while_another_thread_hands_over() {
    let [handed, judged, ended] = [0, 0, 0].map(|n| Arc::new(AtomicUsize::new(n)));
    let counts = [&handed, &judged, &ended].map(Arc::clone);
    let until_one_waits = move || {
        let [handed, judged, ended] = &counts;
        let with_next = judged.fetch_add(1, Ordering::AcqRel) + 2;
        while handed.load(Ordering::Acquire) < with_next && ended.load(Ordering::Acquire) == 0 {
            thread::yield_now();
        }
    };
    let params = Params::default().with_tile(16).with_schedule(Schedule::Every { step: 16 });
    let judge = calls(u64::MAX, until_one_waits);
    let session = Session::new(32, 16, judge, params.with_max_spp(1 << 40)).unwrap();
    let background = Background::new(session, 1, WhenFull::Wait).unwrap();
    let mut noise = Noise::new(63);
    let mut pass = || {
        let image = (0..512).map(|_| [(0.5 + 0.05 * noise.normal()) as f32; 3]).collect();
        background.push_image(16, image)?;
        background.judge()?;
        handed.fetch_add(1, Ordering::AcqRel);
        Ok::<(), SessionError>(())
    };
    thread::scope(|scope| {
        let renderer = scope.spawn(|| {
            let failed = (0..1000).find_map(|_| pass().err());
            ended.store(1, Ordering::Release);
            failed
        });
        while judged.load(Ordering::Acquire) < 4 && !renderer.is_finished() {
            thread::yield_now();
        }
        let spp = background.take_session().unwrap().film().spp(0);
        let failed = renderer.join().unwrap().expect("it goes on until it is refused");
        assert!(failed.to_string().ends_with("the session was given back"), "{failed}");
        assert_eq!(spp, 16 * handed.load(Ordering::Acquire) as u64);
    });
}

/// A panic while the session is looked at is that of who looks.
#[test]
fn a_panic_in_a_look_leaves_the_session() {
    let background = Background::new(of_calls(|| ()), 1, WhenFull::Wait).unwrap();
    grey(&background).unwrap();
    let looked = catch_unwind(AssertUnwindSafe(|| background.look(|_| panic!("no disk"))));
    assert_eq!(said(&*looked.unwrap_err()), "no disk");
    grey(&background).unwrap();
    assert_eq!(background.finish().unwrap().judged, 2);
    assert_eq!(background.into_session().unwrap().film().spp(0), 32);
}

/// Samples count once, even if an embedder's pool does its work twice.
#[test]
fn work_that_is_done_twice_counts_once() {
    let twice = |work: &mut (dyn FnMut() + Send)| (0..2).for_each(|_| work());
    let background = Background::new_in(of_calls(|| ()), 1, WhenFull::Wait, twice).unwrap();
    (0..3).for_each(|_| grey(&background).unwrap());
    background.finish().unwrap();
    assert_eq!(background.into_session().unwrap().film().spp(0), 48);
}
