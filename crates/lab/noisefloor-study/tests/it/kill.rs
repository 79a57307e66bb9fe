use crate::kit::{Folder, levels, public};
use noisefloor_pages::http::Exposure;
use noisefloor_study::explore::{ExploreServer, ExploreSetup};
use noisefloor_study::simulated::drive;
use noisefloor_study::{Study, StudyServer, store};
use noisefloor_testkit::HANG;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Names the study for [`serve_for_another_process`].
pub(crate) const STUDY: &str = "NOISEFLOOR_TEST_STUDY";

/// Not a test: the server, when another test starts this program again with a study. It prints its address,
/// and runs until it is killed.
#[test]
#[ignore = "a part of other tests"]
fn serve_for_another_process() {
    let Some(file) = std::env::var_os(STUDY) else { return };
    let study = Arc::new(Study::open(file).unwrap());
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
    runtime.block_on(async {
        let server =
            StudyServer::bind(study, ([127, 0, 0, 1], 0).into(), &Exposure::default()).await.unwrap();
        let server = server.admitting_simulated();
        println!("\nserving http://{}", server.address());
        server.run(std::future::pending()).await.unwrap();
    });
}

/// Not a test: an explorer, likewise.
#[test]
#[ignore = "a part of other tests"]
fn explore_for_another_process() {
    let Some(dir) = std::env::var_os(STUDY).map(std::path::PathBuf::from) else { return };
    let pictures = [100, 400, 1600].map(|spp| dir.join(format!("wall/{spp:05}.png"))).to_vec();
    let setup = ExploreSetup { pictures, tile: 64, ..ExploreSetup::new(dir.join("explore.sqlite")) };
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
    runtime.block_on(async {
        let server =
            ExploreServer::bind(setup, ([127, 0, 0, 1], 0).into(), &Exposure::default()).await.unwrap();
        println!("\nserving http://{}", server.address());
        server.run(std::future::pending()).await.unwrap();
    });
}

/// The server in a process of its own, and its address.
pub(crate) fn process(folder: &Folder) -> (std::process::Child, String) {
    start("kill::serve_for_another_process", &folder.file)
}

/// This program again, as one of the servers above, and its address.
pub(crate) fn start(what: &str, of: &std::path::Path) -> (std::process::Child, String) {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", what, "--ignored", "--nocapture"])
        .env(STUDY, of)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map_while(Result::ok);
    let url = lines.find_map(|line| line.strip_prefix("serving ").map(str::to_owned));
    // The test harness of the child says more after a minute, and ends if nobody listens
    std::thread::spawn(move || lines.for_each(drop));
    (child, url.unwrap())
}

#[test]
fn a_killed_server_has_lost_nothing() {
    kill_servers(5);
}

/// `cargo test -p noisefloor-study --test it -- --ignored --nocapture a_hundred`
#[test]
#[ignore = "takes minutes"]
fn a_hundred_killed_servers_have_lost_nothing() {
    kill_servers(100);
}

/// Killed (SIGKILL) while eight observers click, a number of times: every event that was acknowledged is
/// there afterwards, each once and in order, and at most one more a session, which was on its way.
fn kill_servers(kills: u64) {
    let folder = Folder::new("acquisition", &["wall", "door"], &levels(40, 1.15), "");
    let study = folder.study();
    let mut acknowledged_in_all = 0;
    for round in 0..kills {
        let (mut child, url) = process(&folder);
        let before: usize =
            store::read_all(&study.database, &study.design()).unwrap().iter().map(|r| r.events.len()).sum();
        let counts: Vec<AtomicU64> = (0..8).map(|_| AtomicU64::new(0)).collect();
        std::thread::scope(|scope| {
            for (i, count) in counts.iter().enumerate() {
                let url = &url;
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
    println!("{acknowledged_in_all} events acknowledged in {kills} rounds, none lost");
}
