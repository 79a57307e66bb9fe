use crate::kit::{Fake, expected, requests, tiles};
use noisefloor::{ProgressiveSource, Request, SourceError, watch::ImpossibleLight};
use noisefloor_sidecar::{SidecarCause, SidecarError};
use noisefloor_testkit::HANG;
use std::error::Error;
use std::time::{Duration, Instant};

/// The error of the second call, and the source after it.
fn failure(fake: &Fake) -> (SourceError, noisefloor_sidecar::Sidecar) {
    let mut source = fake.open().unwrap();
    source.sample(&requests(0, 1)).unwrap();
    let error = source.sample(&requests(1, 1)).unwrap_err();
    (error, source)
}

fn cause(error: &SourceError) -> &SidecarError {
    error.source().unwrap().downcast_ref().unwrap()
}

/// Every way to break a process or its stream ends in an error within the time, names the renderer and what
/// it was at, and a new process has been tried.
#[test]
fn a_process_that_fails_again_and_again_is_an_error() {
    let wrong = [
        ("announce a long payload", "4294967295 bytes where at most 23040"),
        ("announce a pixel too many", "23052 bytes where at most 23040"),
        ("announce a long header", "1048577 bytes where at most 1048576"),
        ("send no JSON", "expected value"),
        ("send a list", "invalid"),
        ("nest deeply", "EOF while parsing"),
        ("send strange counts", "expected u64"),
        ("send too few counts", "1 sample counts for 4 tiles"),
        ("send no counts", "missing field `samples`"),
        ("claim many samples", "4294967295 samples where 1 were requested"),
        ("give too many", "4 samples where 1 were requested"),
        ("stop much too late", "100001 samples where 1 were requested"),
    ];
    // Here, since threads do not know whose they are
    if Fake::new(wrong[0].0).is_none() {
        return;
    }
    let is_wrong = |how: &str, words: &str| {
        let Some(fake) = Fake::new(how) else { return };
        let (error, source) = failure(&fake);
        let cause = cause(&error);
        assert!(matches!(*cause.cause, SidecarCause::Wrong { .. }), "{how}: {cause:?}");
        let said = cause.to_string();
        assert!(said.starts_with("Fake 1, sampling 4 tiles, 0 to 3: its answer is wrong: "), "{how}: {said}");
        assert!(said.contains(words), "{how}: {said}");
        assert!(source.restarts().is_empty());
    };
    let died = |how: &str| {
        let Some(fake) = Fake::new(how) else { return };
        let (error, _) = failure(&fake);
        let cause = cause(&error);
        assert!(matches!(*cause.cause, SidecarCause::Died { .. }), "{how}: {cause:?}");
        assert_eq!(cause.tile, None, "{how}");
    };
    // Four at a time: each begins two processes, and mostly waits for them
    for wrong in wrong.chunks(4) {
        std::thread::scope(|scope| {
            wrong.iter().for_each(|(how, words)| drop(scope.spawn(move || is_wrong(how, words))));
        });
    }
    std::thread::scope(|scope| {
        for how in ["die", "crash", "close standard output", "stop in the middle"] {
            scope.spawn(move || died(how));
        }
    });
}

#[test]
fn the_last_words_are_told() {
    let Some(fake) = Fake::new("die") else { return };
    let mut source = fake.open().unwrap();
    source.sample(&requests(0, 1)).unwrap();
    let one = Request::new(tiles()[3], 1, 1);
    let error = source.sample(&[one]).unwrap_err();
    let SourceError::Failed { name, tile, .. } = &error else { panic!("{error:?}") };
    assert_eq!((name.as_str(), *tile), ("Fake 1", Some(3)));
    let cause = cause(&error);
    assert!(cause.last_words.ends_with("out of lamps") && cause.last_words.len() <= 4096, "{cause}");
    assert!(cause.to_string().contains("sampling tile 3: its process ended (exit status: 7)"), "{cause}");
}

#[test]
fn a_hanging_process_costs_the_time_allowed_twice() {
    let Some(mut fake) = Fake::new("hang") else { return };
    fake.job.timeout = Duration::from_secs(3);
    let begun = Instant::now();
    let (error, _) = failure(&fake);
    assert!(matches!(*cause(&error).cause, SidecarCause::Silent { .. }), "{error:?}");
    assert!(begun.elapsed() < HANG, "{:?}", begun.elapsed());
}

/// One restart costs the batch in flight, and not its samples: they are those that the first process would
/// have sent.
#[test]
fn one_failure_is_mended_by_a_new_process() {
    let ways = ["die", "crash", "send no JSON", "announce a long payload", "close standard output"];
    for how in ways.into_iter().chain(["stop in the middle", "hang"]) {
        let Some(fake) = Fake::new(how) else { return };
        let mut fake = fake.once();
        fake.job.timeout = Duration::from_secs(if how == "hang" { 3 } else { 60 });
        let mut source = fake.open().unwrap();
        for first in 0..4 {
            let requests = requests(first, 1);
            let batches = source.sample(&requests).unwrap();
            assert!(batches.iter().zip(&requests).all(|(b, r)| b.mean == expected(5, r)), "{how}");
        }
        assert_eq!((source.restarts().len(), fake.pids().len()), (1, 2), "{how}");
    }
}

#[test]
fn a_process_that_comes_back_another_is_an_error() {
    let Some(fake) = Fake::new("change") else { return };
    let (error, _) = failure(&fake);
    assert!(error.source().unwrap().to_string().contains("after a restart"), "{error:?}");
}

/// The renderer says that it cannot: no restart, and it goes on.
#[test]
fn a_refusal_is_an_error_and_no_more() {
    for (how, tile, words) in [
        ("refuse", Some(2), "no memory for textures"),
        ("exit", None, "SystemExit: I want out"),
        ("send too little", None, "ValueError"),
        ("forget a tile", None, "3 batches for 4 tiles"),
    ] {
        let Some(fake) = Fake::new(how) else { return };
        let fake = fake.once();
        let (error, mut source) = failure(&fake);
        let SourceError::Failed { tile: named, .. } = &error else { panic!("{error:?}") };
        assert_eq!(*named, tile, "{how}");
        let cause = cause(&error);
        assert!(
            matches!(&*cause.cause, SidecarCause::Refused(said) if said.contains(words)),
            "{how}: {cause}"
        );
        assert!(cause.last_words.contains("Traceback"), "{how}: {cause}");
        assert_eq!(source.sample(&requests(2, 1)).unwrap().len(), 4, "{how}");
        assert_eq!(fake.pids().len(), 1, "{how}");
    }
}

#[test]
fn tiles_outside_the_image_are_refused_by_name() {
    let Some(fake) = Fake::new("work") else { return };
    let mut source = fake.open().unwrap();
    let mut request = requests(0, 1)[3];
    request.tile.x += 1;
    let error = source.sample(&[requests(0, 1)[0], request]).unwrap_err();
    assert_eq!(cause(&error).tile, Some(3));
    assert!(cause(&error).to_string().contains("not inside the image of 48x40"), "{error:?}");
}

#[test]
fn a_tile_of_nothing_finite_is_an_error_a_pixel_is_not() {
    let Some(fake) = Fake::new("send NaN") else { return };
    let fake = fake.once();
    let (error, mut source) = failure(&fake);
    let light = ImpossibleLight::NotFinite { percent: 100.0 };
    assert!(matches!(*cause(&error).cause, SidecarCause::Light(said) if said == light));
    assert_eq!(cause(&error).tile, Some(1));
    assert!(source.sample(&requests(2, 1)).is_ok());

    let Some(fake) = Fake::new("send some NaN") else { return };
    let mut source = fake.open().unwrap();
    source.sample(&requests(0, 1)).unwrap();
    let mean = source.sample(&requests(1, 1)).unwrap().remove(1).mean;
    assert_eq!(mean.iter().flatten().filter(|c| c.is_nan()).count(), 1);
    assert!(mean[1][2].is_nan());
}

/// Well-formed batches that cannot be light are errors of their tile, with no restart: a new process would
/// send the same.
#[test]
fn impossible_light_is_an_error() {
    for (how, words) in [
        ("send mostly NaN", "83 % of the tile's pixels are not finite"),
        ("send negative light", "mean luminance is negative (-1.4"),
    ] {
        let Some(fake) = Fake::new(how) else { return };
        let (error, source) = failure(&fake);
        let cause = cause(&error);
        assert!(matches!(*cause.cause, SidecarCause::Light(_)) && cause.tile == Some(1), "{how}: {cause:?}");
        assert!(cause.to_string().contains(words), "{how}: {cause}");
        assert!(source.restarts().is_empty() && fake.pids().len() == 1, "{how}");
    }
}

/// What a renderer writes reaches terminals: names, warnings, refusals and last words carry no escapes.
#[test]
fn nothing_from_outside_moves_the_cursor() {
    let Some(fake) = Fake::new("paint") else { return };
    let (error, source) = failure(&fake);
    let cause = cause(&error);
    let said = format!("{error} {cause} {} {}", cause.last_words, source.info().name);
    assert!(said.contains("no memory\\u{1b}[2J for") && said.contains("\\u{1b}]0;owned"), "{said}");
    assert!(!said.contains(|c: char| c.is_control() && c != '\n'), "{said:?}");
    assert!(source.warnings()[0].contains("\\u{202e}"), "{:?}", source.warnings());

    let Some(fake) = Fake::new("paint the unit") else { return };
    let said = fake.open().unwrap_err().to_string();
    assert!(said.contains("unknown variant") && !said.contains('\x1b'), "{said:?}");
}

/// Whatever a renderer prints, and whoever reads standard input, the stream of frames is not theirs.
#[test]
fn printing_does_no_harm() {
    for how in ["print", "read standard input"] {
        let Some(fake) = Fake::new(how) else { return };
        let mut source = fake.open().unwrap();
        source.sample(&requests(0, 1)).unwrap();
        for first in 1..4 {
            assert_eq!(
                source.sample(&requests(first, 1)).unwrap()[0].mean,
                expected(5, &requests(first, 1)[0])
            );
        }
        assert_eq!(fake.pids().len(), 1);
    }
}

#[test]
fn a_scene_that_cannot_be_loaded_is_an_error_at_once() {
    for (how, words) in [
        ("refuse the scene", "ValueError: no such lamp"),
        ("die at once", "its process ended (exit status: 3)"),
        ("claim a huge image", "its answer is wrong"),
        ("describe nothing", "missing field `name`"),
    ] {
        let Some(fake) = Fake::new(how) else { return };
        let error = fake.open().unwrap_err();
        assert!(error.to_string().contains(words), "{how}: {error}");
        assert!(error.to_string().contains("scene π.fake"), "{how}: {error}");
    }
    let Some(mut fake) = Fake::new("work") else { return };
    fake.job.scene = fake.folder.path().join("not there");
    let error = fake.open().unwrap_err();
    assert!(matches!(*error.cause, SidecarCause::Scene { .. }) && error.to_string().contains("not there"));
}

#[test]
fn an_interpreter_that_is_not_there_is_named() {
    let Some(fake) = Fake::new("work") else { return };
    let python = fake.folder.path().join("no python");
    let error = noisefloor_sidecar::Sidecar::open(&crate::kit::FAKE, &python, &fake.job, Default::default())
        .unwrap_err();
    assert!(matches!(*error.cause, SidecarCause::Start { .. }), "{error}");
    assert!(error.to_string().contains("no python"), "{error}");
}

/// A renderer that cannot stop in time says so, and is believed within bounds.
#[test]
fn a_renderer_that_stops_late_is_believed() {
    let Some(fake) = Fake::new("stop late") else { return };
    let mut source = fake.open().unwrap();
    source.sample(&requests(0, 1)).unwrap();
    assert!(source.sample(&requests(1, 1)).unwrap().iter().all(|batch| batch.spp == 4));
}

/// Its identity is the scene's contents; a process that is started again after an edit would mix two scenes.
#[test]
fn a_scene_edited_before_a_restart_is_refused() {
    let Some(fake) = Fake::new("die") else { return };
    let fake = fake.once();
    let mut source = fake.open().unwrap();
    let identity = source.identity().unwrap();
    assert_eq!(identity.files().collect::<Vec<_>>(), ["scene π.fake"]);
    source.sample(&requests(0, 1)).unwrap();
    std::fs::write(&fake.job.scene, "darker lamps").unwrap();
    let error = source.sample(&requests(1, 1)).unwrap_err();
    let said = cause(&error).to_string();
    assert!(said.contains("another scene: `scene π.fake` has changed"), "{said}");
    let change = fake.open().unwrap().identity().unwrap().change_since(&identity);
    assert_eq!(change.unwrap().to_string(), "`scene π.fake` has changed");
}
