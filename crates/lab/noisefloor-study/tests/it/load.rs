use crate::kill::process;
use crate::kit::{Folder, levels, public};
use noisefloor_study::simulated::drive;
use noisefloor_study::{Study, store};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Two hundred observers who click twice a second, and fifty who click as fast as they are answered; a server
/// in a process of its own. Times are printed, not checked, since other work on the machine would decide:
/// `cargo test -p noisefloor-study -- --ignored at_once --nocapture`. What is checked: nothing is lost.
#[test]
#[ignore = "measures time: run it alone"]
fn two_hundred_observers_at_once() {
    let folder = Folder::new("acquisition", &["wall", "door"], &levels(24, 1.3), "");
    let study = folder.study();
    let (mut child, url) = process(&folder);
    for (observers, pause) in [(200, 500), (50, 0)] {
        let before = events(&study);
        let times = Mutex::new(Vec::new());
        let begun = Instant::now();
        std::thread::scope(|scope| {
            for seed in 0..observers {
                let (url, times) = (&url, &times);
                scope.spawn(move || {
                    let mut own = Vec::new();
                    let mut observer = public(2, &[200.0, 600.0]).draw(seed);
                    let noted = |time| {
                        own.push(time);
                        std::thread::sleep(Duration::from_millis(pause));
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
        println!(
            "{observers} observers, {pause} ms between clicks: {} events in {seconds:.1} s ({:.0}/s), \
             p50 {:.1} ms, p99 {:.1} ms, most {:.1} ms",
            times.len(),
            times.len() as f64 / seconds,
            at(0.5),
            at(0.99),
            at(1.0)
        );
        assert_eq!(events(&study) - before, times.len(), "events were lost");
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

fn events(study: &Arc<Study>) -> usize {
    store::read_all(&study.database, &study.design()).unwrap().iter().map(|r| r.events.len()).sum()
}
