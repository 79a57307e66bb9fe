use super::*;
use crate::criterion::{FixedSpp, Needs};
use crate::params::Schedule;
use crate::session::StopReason;
use crate::source::{Reference, Repeats, SourceInfo};
use crate::tests::judging;

/// A grey source that can be told to misbehave.
#[derive(Default)]
struct Grey {
    cannot_aim: bool,
    /// Samples per pixel it has in store; 0 for no end.
    store: u64,
    fail_after: Option<usize>,
    lie: Option<fn(Vec<Batch>) -> Vec<Batch>>,
    calls: Vec<Vec<Request>>,
}

impl ProgressiveSource for Grey {
    fn info(&self) -> SourceInfo {
        SourceInfo::new("grey", 80, 32).with_aims(!self.cannot_aim).with_repeats(Repeats::Samples)
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        if self.fail_after.is_some_and(|calls| self.calls.len() >= calls) {
            return Err(SourceError::Failed {
                name: "grey".into(),
                tile: Some(1),
                cause: "lamp broke".into(),
            });
        }
        self.calls.push(requests.to_vec());
        let batch = |r: &Request| {
            let left = if self.store == 0 { u64::MAX } else { self.store.saturating_sub(r.first) };
            let spp = r.spp.min(left);
            let mean = if spp == 0 { vec![] } else { vec![[0.5; 3]; r.tile.pixels()] };
            Batch { tile: r.tile, spp, mean }
        };
        let batches = requests.iter().map(batch).collect();
        Ok(self.lie.map_or_else(|| Vec::clone(&batches), |lie| lie(batches.clone())))
    }
}

fn driver(source: Grey, samples: u64) -> Driver<Grey, FixedSpp> {
    let params =
        Params::default().with_tile(32).with_schedule(Schedule::Spaced { step: 10 }).with_min_spp(100);
    Driver::new(source, FixedSpp(samples), params).unwrap()
}

fn reasons<C: StoppingCriterion>(driver: &Driver<Grey, C>) -> Vec<(u64, StopReason)> {
    driver.session().stops().map(|s| (s.spp, s.reason)).collect()
}

#[test]
fn events_and_timeline_tell_the_whole_run() {
    let mut driver = driver(Grey::default(), 300);
    let (mut stops, mut batches) = (0, 0);
    driver
        .run(|session, event| match event {
            Event::TileStopped(stop) => {
                stops += 1;
                assert_eq!(stop.spp, session.film().spp(stop.tile.index));
            }
            Event::BatchDone(progress) => {
                batches += 1;
                assert!(
                    progress.tiles == 3 && (progress.now.active_tiles == 0 || progress.eta_seconds.is_some())
                );
            }
            Event::ReferenceReady { .. } => panic!("nobody needs one"),
        })
        .unwrap();
    assert_eq!((stops, batches), (3, driver.timeline().len()));
    assert_eq!(driver.timeline().last().unwrap().samples, 300 * 80 * 32);
    assert!(driver.timeline().is_sorted_by_key(|p| p.samples));
    let clock = driver.clock();
    assert!(clock.source_seconds + clock.criterion_seconds <= clock.total_seconds);
}

#[test]
fn a_source_that_cannot_aim_is_asked_for_all_tiles() {
    let mut driver = driver(Grey { cannot_aim: true, ..Grey::default() }, 200);
    driver.run(|_, _| ()).unwrap();
    assert!(driver.source.calls.iter().all(|c| c.len() == 3));
}

#[test]
fn the_end_of_a_playback_is_a_reason() {
    let mut driver = driver(Grey { store: 250, ..Grey::default() }, 1000);
    driver.run(|_, _| ()).unwrap();
    assert_eq!(reasons(&driver), [(250, StopReason::SourceExhausted); 3]);
}

#[test]
fn limits_stop_and_keep_what_is_there() {
    let mut limited = driver(Grey::default(), 10_000);
    limited.set_time_limit(Some(Duration::ZERO));
    limited.run(|_, _| ()).unwrap();
    // One call
    assert_eq!(reasons(&limited), [(100, StopReason::TimeLimit); 3]);

    let mut cancelled = driver(Grey::default(), 10_000);
    let flag = cancelled.cancel_flag();
    cancelled
        .run(|_, event| {
            if matches!(event, Event::BatchDone(_)) {
                flag.store(true, Ordering::Relaxed)
            }
        })
        .unwrap();
    assert_eq!(reasons(&cancelled), [(100, StopReason::Cancelled); 3]);
}

#[test]
fn a_failure_keeps_what_is_there() {
    let mut driver = driver(Grey { fail_after: Some(2), ..Grey::default() }, 10_000);
    let error = driver.run(|_, _| ()).unwrap_err();
    assert!(error.to_string().contains("grey: sampling failed in tile 1"), "{error}");
    // Three quarters of the way to twice the samples of the first verdict, in steps of 10
    assert_eq!(reasons(&driver), [(170, StopReason::Failed); 3]);
}

#[test]
fn broken_promises_are_typed_errors() {
    let lies: [fn(Vec<Batch>) -> Vec<Batch>; 6] = [
        |mut b| {
            b[2].spp += 1;
            b
        },
        |mut b| {
            b.pop();
            b
        },
        |mut b| {
            b.swap(0, 1);
            b
        },
        |mut b| {
            b[0].mean.pop();
            b
        },
        // What is no light: mostly NaN, and mostly negative
        |mut b| {
            b[1].mean.iter_mut().enumerate().filter(|(i, _)| i % 6 != 0).for_each(|(_, p)| p[1] = f32::NAN);
            b
        },
        |mut b| {
            b[1].mean.iter_mut().step_by(7).for_each(|p| *p = [-1e6; 3]);
            b
        },
    ];
    for lie in lies {
        let error = driver(Grey { lie: Some(lie), ..Grey::default() }, 100).run(|_, _| ()).unwrap_err();
        assert!(matches!(error, DriverError::Source(SourceError::Contract { .. })), "{error}");
    }
}

fn picky() -> impl StoppingCriterion {
    judging(Needs::REFERENCE, |_, _| Ok(vec![]))
}

#[test]
fn a_missing_reference_is_an_error_before_any_sample() {
    let mut driver = Driver::new(Grey::default(), picky(), Params { tile: 32, ..Params::default() }).unwrap();
    let error = driver.run(|_, _| ()).unwrap_err();
    assert!(matches!(error, DriverError::Criterion(CriterionError::NoReference(_))));
    assert!(driver.source.calls.is_empty());
}

#[test]
fn a_reference_is_rendered_once_before_any_sample() {
    let mut driver = Driver::new(Grey::default(), picky(), Params { tile: 32, ..Params::default() }).unwrap();
    driver.set_reference(|source| {
        assert!(source.calls.is_empty(), "samples came first");
        Ok(Some(Reference::new((80, 32), vec![[0.5; 3]; 80 * 32])))
    });
    let mut ready = 0;
    for _ in 0..2 {
        // It has no verdicts, which is an error of a run
        let _ = driver.run(|_, event| ready += usize::from(matches!(event, Event::ReferenceReady { .. })));
    }
    assert!(ready == 1 && !driver.source.calls.is_empty());
}

/// Tile 0 has no samples at all, and no verdict comes on the others.
#[test]
fn stops_are_told_even_if_a_verdict_fails() {
    let nothing_in_tile_0 = |mut batches: Vec<Batch>| {
        for batch in batches.iter_mut().filter(|batch| batch.tile.index == 0) {
            (batch.spp, batch.mean) = (0, Vec::new());
        }
        batches
    };
    let source = Grey { lie: Some(nothing_in_tile_0), ..Grey::default() };
    let broken = judging(Needs::default(), |_, _| Err(CriterionError::NoReference("broken".into())));
    let mut driver = Driver::new(source, broken, Params::default().with_tile(32)).unwrap();
    let mut told = Vec::new();
    let outcome = driver.run(|_, event| {
        if let Event::TileStopped(stop) = event {
            told.push((stop.tile.index, stop.reason));
        }
    });
    assert!(matches!(outcome, Err(DriverError::Criterion(_))));
    let (exhausted, failed) = (StopReason::SourceExhausted, StopReason::Failed);
    assert_eq!(told, [(0, exhausted), (1, failed), (2, failed)]);
}

#[test]
fn a_second_run_counts_on() {
    let mut driver = driver(Grey::default(), 300);
    driver.run(|_, _| ()).unwrap();
    let first = driver.clock();
    driver.run(|_, _| ()).unwrap();
    let clock = driver.clock();
    assert!(clock.total_seconds >= first.total_seconds);
    assert!(clock.source_seconds + clock.criterion_seconds <= clock.total_seconds, "{clock:?}");
}

/// The tiles of a picture too large for one call grow together, in calls that are full.
#[test]
fn large_pictures_take_turns() {
    let grid = crate::TileGrid::new(7680, 4320, 512).unwrap();
    let mut spp = vec![0; grid.len()];
    for call in 0..60 {
        let mut requests: Vec<_> = grid.tiles().map(|tile| Request::new(tile, spp[tile.index], 1)).collect();
        keep_rearmost(&mut requests);
        let samples: u64 = requests.iter().map(|r| r.tile.pixels() as u64).sum();
        // What does not fit is a tile; those of the last row have 736 lines
        assert!(samples <= CALL_SAMPLES && samples > CALL_SAMPLES - 512 * 736, "{call}: {samples}");
        assert!(requests.is_sorted_by_key(|r| r.tile.index), "{call}");
        requests.iter().for_each(|r| spp[r.tile.index] += 1);
        let (least, most) = (spp.iter().min().unwrap(), spp.iter().max().unwrap());
        assert!(most - least <= 1, "{call}: {least} to {most}");
    }
    assert!(spp.iter().all(|&n| n >= 6), "60 calls of 4 million samples on 33 million pixels");
}
