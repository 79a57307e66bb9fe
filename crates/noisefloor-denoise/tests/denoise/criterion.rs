use crate::kit::{SIZE, Simple, noisy, truth};
use noisefloor::{
    Params, Rgb, Schedule, Session, SessionError, StopReason, StoppingCriterion, ToneMapping,
    criterion::CriterionError, source::FirstHits,
};
use noisefloor_denoise::{
    AuxiliaryPictures, DenoiseError, DenoisedError, DenoisedQuality, Denoiser, ESTIMATE_ERRS_BY,
    NoisyPicture, spp_with_denoising, spp_without_denoising,
};
use noisefloor_vision::{VisionModel, VisionWorkspace};
use std::sync::{Arc, Mutex};

/// Deviation of one sample.
const NOISE: f32 = 0.1;

/// A session of the striped wall in tiles of 64, until 2,000 spp at most.
fn session<D: Denoiser>(denoiser: D) -> Session<DenoisedQuality<D>> {
    session_in_tiles(64, denoiser)
}

fn session_in_tiles<D: Denoiser>(edge: usize, denoiser: D) -> Session<DenoisedQuality<D>> {
    let criterion = DenoisedQuality::new(denoiser, 0.1);
    let params = Params::default()
        .with_tile(edge)
        .with_schedule(Schedule::Growing { step: 20 })
        .with_min_spp(20)
        .with_max_spp(2_000)
        .with_tone_mapping(ToneMapping::Srgb { exposure: 1.0 });
    Session::new(SIZE.0, SIZE.1, criterion, params).unwrap()
}

/// Renders, and returns the stops' samples per pixel: 0 and 3 are striped, the others plain.
fn run<D: Denoiser>(session: &mut Session<DenoisedQuality<D>>) -> Result<Vec<u64>, SessionError> {
    run_with(session, 0)
}

/// The same with other noise.
fn run_with<D: Denoiser>(
    session: &mut Session<DenoisedQuality<D>>,
    run: u64,
) -> Result<Vec<u64>, SessionError> {
    while !session.is_done() {
        for request in session.requests() {
            let seed = (run << 32) + 1000 * request.first + request.tile.index as u64;
            let picture = noisy(seed, NOISE / (request.spp as f32).sqrt());
            let tile: Vec<_> = request.tile.rows(SIZE.0).flatten().map(|i| picture[i]).collect();
            session.push(request.tile.index, request.spp, &tile).unwrap();
        }
        session.judge()?;
    }
    Ok(session.stops().map(|stop| stop.spp).collect())
}

#[test]
fn a_plain_wall_is_done_sooner_when_denoised_and_a_smeared_one_is_not() {
    let plain = run(&mut session(Simple::Nothing)).unwrap();
    let mut denoised = session(Simple::Bilateral(0.3));
    let stops = run(&mut denoised).unwrap();
    assert!([2, 5].into_iter().all(|tile| stops[tile] < plain[tile]), "{stops:?} and {plain:?}");
    // The filter smears the stripes, however many samples they have: they are done when their noise is, by verdicts at
    // other samples
    assert!([0, 3].into_iter().all(|tile| stops[tile] < 2 * plain[tile]), "{stops:?} and {plain:?}");

    // What is recorded beside: the error at the end
    let record = denoised.criterion().record();
    let record = record.lock().unwrap();
    assert_eq!(record.error.as_ref().unwrap().size(), SIZE);
    let allowed = 0.1 / ESTIMATE_ERRS_BY;
    assert!(record.jods_lost.iter().all(|&lost| lost <= allowed), "{:?}", record.jods_lost);
    assert_eq!([0, 2, 3, 5].map(|tile| record.undenoised[tile]), [true, false, true, false]);
    // They are shown as they were rendered
    let grid = denoised.film().grid();
    let (rendered, mut shown) = (denoised.film().image(), vec![[0.0; 3]; SIZE.0 * SIZE.1]);
    record.compose(grid, &rendered, &mut shown);
    assert!(shown[0] == rendered[0] && shown[SIZE.0 - 1] == [0.0; 3]);
    assert!(record.verdicts > 0 && record.seconds > 0.0);
}

/// A tile stops where its estimate errs to the low side: the margin makes up for that.
#[test]
fn nineteen_of_twenty_tiles_that_stop_have_lost_no_more_than_is_allowed() {
    let (mut stopped, mut more, mut worst) = (0, 0, 0.0_f64);
    for seed in 1..=10 {
        let mut session = session(Simple::Bilateral(0.1));
        run_with(&mut session, seed).unwrap();
        let display = session.display_so_far();
        let rendered = session.film().image();
        let mut denoised = Simple::Bilateral(0.1).of(&rendered);
        session.criterion().record().lock().unwrap().compose(session.film().grid(), &rendered, &mut denoised);
        let error = DenoisedError::known(SIZE, &denoised, &truth(), &display).unwrap();
        let (eyes, mut room) = (VisionModel::new(&session.params().viewing), VisionWorkspace::default());
        for stop in session.stops().filter(|stop| stop.reason == StopReason::Converged) {
            let lost = error.jods_lost(stop.tile, &eyes, &mut room).unwrap();
            (stopped, more, worst) = (stopped + 1, more + usize::from(lost > 0.1), worst.max(lost));
        }
    }
    println!("{more} of {stopped} have lost more, at most {worst}");
    assert!(stopped >= 20);
    // Two standard deviations of a binomial distribution above one in twenty
    let expected = stopped as f64 / 20.0;
    assert!((more as f64) <= expected + 2.0 * (expected * 0.95).sqrt(), "{more} of {stopped}, worst {worst}");
}

/// Tiles that are smaller than squares of 64 pixels take fewer samples, and as few squares have lost too much.
#[test]
fn squares_keep_the_limit_in_small_tiles_too() {
    let (mut squares, mut more, mut spp) = (0, 0, [0.0; 2]);
    for seed in 1..=6 {
        for (edge, spp) in [64, 32].into_iter().zip(&mut spp) {
            let mut session = session_in_tiles(edge, Simple::Bilateral(0.1));
            run_with(&mut session, seed).unwrap();
            let film = session.film();
            *spp += film.grid().tiles().map(|t| film.spp(t.index) as f64 * t.pixels() as f64).sum::<f64>();
            if edge == 64 {
                continue;
            }
            let rendered = session.film().image();
            let mut denoised = Simple::Bilateral(0.1).of(&rendered);
            let record = session.criterion().record();
            record.lock().unwrap().compose(session.film().grid(), &rendered, &mut denoised);
            let error = DenoisedError::known(SIZE, &denoised, &truth(), &session.display_so_far()).unwrap();
            let (eyes, mut room) = (VisionModel::new(&session.params().viewing), VisionWorkspace::default());
            for square in noisefloor::TileGrid::new(SIZE.0, SIZE.1, 64).unwrap().tiles() {
                let lost = error.jods_lost(square, &eyes, &mut room).unwrap();
                (squares, more) = (squares + 1, more + usize::from(lost > 0.1));
            }
        }
    }
    println!("{more} of {squares} have lost more; samples in tiles of 64 and of 32: {spp:?}");
    let expected = squares as f64 / 20.0;
    assert!((more as f64) <= expected + 2.0 * (expected * 0.95).sqrt(), "{more} of {squares}");
    assert!(spp[1] <= spp[0], "{spp:?}");
}

/// A film of the striped wall with so many samples per pixel everywhere.
fn sampled<D: Denoiser>(denoiser: D, spp: u64) -> Session<DenoisedQuality<D>> {
    let mut session = session(denoiser);
    let tiles: Vec<_> = session.film().grid().tiles().collect();
    for half in [0, 1] {
        let picture = crate::kit::noisy(77 + half, NOISE / (spp as f32 / 2.0).sqrt());
        for tile in &tiles {
            let pixels: Vec<_> = tile.rows(SIZE.0).flatten().map(|i| picture[i]).collect();
            session.push(tile.index, spp / 2, &pixels).unwrap();
        }
    }
    session
}

/// What a picture would need without denoising is what it does need where nothing denoises it.
#[test]
fn the_need_without_denoising_is_that_of_the_noisy_picture() {
    let mut noisy = session(Simple::Nothing);
    let stops = run(&mut noisy).unwrap();
    let needed = stops.iter().sum::<u64>() as f64 / stops.len() as f64;
    for (spp, tolerance) in [(40, 0.4), (200, 0.2)] {
        let session = sampled(Simple::Fails, spp);
        let (display, viewing) = (session.params().tone_mapping.settle(&truth()), session.params().viewing);
        let limit = 0.1 / ESTIMATE_ERRS_BY;
        let found = spp_without_denoising(session.film(), &display, &truth(), viewing, limit).unwrap();
        assert!((found / needed).ln().abs() < tolerance, "{found} by {spp}, and {needed}");
    }
}

/// What a denoised picture would need, from a film of about as many samples; from one of four times as many less well,
/// since noise that nothing denoises falls faster than what Open Image Denoise leaves.
#[test]
fn the_need_with_a_denoiser_is_that_of_the_denoised_picture() {
    let stops = run(&mut session(Simple::Nothing)).unwrap();
    let needed = stops.iter().sum::<u64>() as f64 / stops.len() as f64;
    for (spp, tolerance) in [(needed as u64 / 2 * 2, 0.25), (4 * needed as u64 / 2 * 2, 0.6)] {
        let session = sampled(Simple::Fails, spp);
        let (display, viewing) = (session.params().tone_mapping.settle(&truth()), session.params().viewing);
        let with = |denoiser| spp_with_denoising(session.film(), &display, denoiser, viewing, 0.1);
        let found = with(Simple::Nothing).unwrap().unwrap();
        assert!((found / needed).ln().abs() < tolerance, "{found} by {spp}, and {needed}");
        assert!(with(Simple::Fails).is_err());
        // A filter that smears the stripes however many samples there are takes no more than none; its noise is seen on what
        // it has smeared
        let smeared = with(Simple::Bilateral(0.3)).unwrap().unwrap();
        assert!(smeared < 1.2 * found, "{smeared} and {found}");
    }
}

#[test]
fn verdicts_repeat() {
    let [one, other] = [0; 2].map(|_| run(&mut session(Simple::Bilateral(0.1))).unwrap());
    assert_eq!(one, other);
}

#[test]
fn a_denoiser_may_be_shared() {
    let shared = Arc::new(Mutex::new(Simple::Flat(0.2)));
    let criterion = DenoisedQuality::new(Arc::clone(&shared), 0.1);
    drop(criterion);
    assert_eq!(Simple::Flat(0.2).of(&truth()), shared.lock().unwrap().of(&truth()));
}

#[test]
fn failures_are_said() {
    let outcome = run(&mut session(Simple::Fails));
    let Err(SessionError::Criterion(CriterionError::Failed { why, .. })) = outcome else {
        panic!("{outcome:?}")
    };
    assert!(why.contains("out of order"), "{why}");
}

/// Notes the albedo that it is given, and takes it for the picture.
struct Guided(Arc<Mutex<Vec<Option<f32>>>>);

impl Denoiser for Guided {
    fn name(&self) -> String {
        "guided".into()
    }

    fn wants(&self) -> AuxiliaryPictures {
        AuxiliaryPictures { albedo: true, normal: false }
    }

    fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError> {
        assert!(picture.normal.is_none(), "what it does not want is kept from it");
        self.0.lock().unwrap().push(picture.albedo.map(|albedo| albedo[0][0]));
        Ok(picture.radiance.to_vec())
    }
}

/// Each half is denoised with its own albedo, and which pictures help is part of the fingerprint.
#[test]
fn halves_have_guides_of_their_own() {
    let seen: Arc<Mutex<Vec<Option<f32>>>> = Arc::default();
    let plain = DenoisedQuality::new(Guided(Arc::clone(&seen)), 0.1);
    let before = plain.fingerprint();
    let hits = |albedo: f32| {
        let (width, height) = SIZE;
        let pixels = |value: f32| vec![[value; 3]; width * height];
        FirstHits { width, height, albedo: pixels(albedo), normal: pixels(0.5) }
    };
    let guided = plain.guided_by(Arc::new([hits(0.25), hits(0.75)]));
    assert_ne!(guided.fingerprint(), before);
    let params = Params::default().with_tile(64).with_max_spp(200);
    run(&mut Session::new(SIZE.0, SIZE.1, guided, params).unwrap()).unwrap();
    let seen = seen.lock().unwrap();
    assert!(!seen.is_empty() && seen.chunks(2).all(|two| two == [Some(0.25), Some(0.75)]), "{seen:?}");
}
