use crate::kill::process;
use crate::kit::{Folder, levels, public};
use noisefloor_study::simulated::drive;
use noisefloor_study::store;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Fifty observers who click as fast as they are answered, far faster than people do; a server in its own
/// process. Measured, not checked against the clock, since other work on the machine would decide; `cargo
/// test --release -- --ignored fifty --nocapture` prints the percentiles. What is checked: nothing is lost.
#[test]
#[ignore = "measures time: run it alone"]
fn fifty_observers_at_once() {
    let folder = Folder::new("acquisition", &["wall", "door"], &levels(60, 1.1), "");
    let study = folder.study();
    let (mut child, url) = process(&folder);
    for pause in [Duration::ZERO, Duration::from_millis(100)] {
        let before: usize =
            store::read_all(&study.database, &study.design()).unwrap().iter().map(|r| r.events.len()).sum();
        let times = Mutex::new(Vec::new());
        let begun = Instant::now();
        std::thread::scope(|scope| {
            for seed in 0..50 {
                let (url, times) = (&url, &times);
                scope.spawn(move || {
                    let mut own = Vec::new();
                    let mut observer = public(2, &[500.0, 1500.0]).draw(seed);
                    let noted = |time| {
                        own.push(time);
                        std::thread::sleep(pause);
                    };
                    drive(url, "", &mut observer, noted).unwrap();
                    times.lock().unwrap().extend(own);
                });
            }
        });
        let seconds = begun.elapsed().as_secs_f64();
        let mut times = times.into_inner().unwrap();
        times.sort();
        let at = |share: f64| 1e3 * times[((times.len() - 1) as f64 * share) as usize].as_secs_f64();
        let after: usize =
            store::read_all(&study.database, &study.design()).unwrap().iter().map(|r| r.events.len()).sum();
        println!(
            "50 observers, {} ms between clicks: {} events in {seconds:.1} s ({:.0}/s), \
             p50 {:.1} ms, p99 {:.1} ms, most {:.1} ms",
            pause.as_millis(),
            times.len(),
            times.len() as f64 / seconds,
            at(0.5),
            at(0.99),
            at(1.0)
        );
        assert_eq!(after - before, times.len(), "events were lost");
    }
    child.kill().unwrap();
    child.wait().unwrap();
}
