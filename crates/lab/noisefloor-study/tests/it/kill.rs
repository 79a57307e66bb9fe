use crate::explore;
use crate::kit::{Folder, Running, levels, public};
use noisefloor_study::simulated::drive;
use noisefloor_study::{Study, store};
use noisefloor_testkit::HANG;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Names the study for [`serve_for_another_process`].
const STUDY: &str = "NOISEFLOOR_TEST_STUDY";

/// Not a test: the server, when another test starts this program again with a study, or an explorer, with a
/// folder. It prints its address, and runs until it is killed.
#[test]
#[ignore = "a part of other tests"]
fn serve_for_another_process() {
    let Some(of) = std::env::var_os(STUDY).map(PathBuf::from) else { return };
    let server = if of.is_dir() {
        Running::explorer(explore::setup_of(&of))
    } else {
        Running::start(Arc::new(Study::open(of).unwrap()))
    };
    println!("\nserving {}", server.address);
    loop {
        std::thread::park();
    }
}

/// This program again, as the server of a study file or an explorer of a folder.
pub(crate) fn process(of: &Path) -> (std::process::Child, Running) {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "kill::serve_for_another_process", "--ignored", "--nocapture"])
        .env(STUDY, of)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map_while(Result::ok);
    let address = lines.find_map(|line| line.strip_prefix("serving ").map(|at| at.parse().unwrap()));
    // The test harness of the child says more after a minute, and ends if nobody listens
    std::thread::spawn(move || lines.for_each(drop));
    (child, Running::elsewhere(address.unwrap()))
}

/// Killed (SIGKILL) while eight observers click, five times: every event that was acknowledged is there
/// afterwards, each once and in order, and at most one more a session, which was on its way.
#[test]
fn a_killed_server_has_lost_nothing() {
    let folder = Folder::new("acquisition", &["wall", "door"], &levels(40, 1.15), "");
    let study = folder.study();
    let mut acknowledged_in_all = 0;
    for round in 0..5 {
        let (mut child, server) = process(&folder.file);
        let before: usize =
            store::read_all(&study.database, &study.design()).unwrap().iter().map(|r| r.events.len()).sum();
        let counts: Vec<AtomicU64> = (0..8).map(|_| AtomicU64::new(0)).collect();
        std::thread::scope(|scope| {
            for (i, count) in counts.iter().enumerate() {
                let url = &server.url;
                scope.spawn(move || {
                    let mut observer = public(2, &[500.0, 2000.0]).draw(100 * round + i as u64);
                    let counted = |_| {
                        count.fetch_add(1, Ordering::SeqCst);
                    };
                    // Ends with an error when the server dies
                    drop(drive(url, "", &mut observer, counted));
                });
            }
            // In the midst of their clicks, after more of them in each round
            let (begun, enough) = (Instant::now(), 25 + 10 * (round % 5));
            let so_far = || counts.iter().map(|count| count.load(Ordering::SeqCst)).sum::<u64>();
            while so_far() < enough && begun.elapsed() < HANG {
                std::thread::sleep(Duration::from_millis(1));
            }
            child.kill().unwrap();
            child.wait().unwrap();
        });
        let acknowledged: u64 = counts.iter().map(|c| c.load(Ordering::SeqCst)).sum();
        let records = store::read_all(&study.database, &study.design()).unwrap();
        let kept = records.iter().map(|r| r.events.len()).sum::<usize>() - before;
        assert!(
            (acknowledged..=acknowledged + 8).contains(&(kept as u64)),
            "{acknowledged} acknowledged, {kept} kept"
        );
        for record in &records {
            assert!(record.events.iter().enumerate().all(|(i, e)| e.seq == i as u64), "{record:?}");
        }
        acknowledged_in_all += acknowledged;
    }
    assert!(acknowledged_in_all > 100, "killed before anything happened: {acknowledged_in_all}");
}
