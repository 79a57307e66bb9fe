//! Nothing is left behind, and nothing piles up. Processes are looked at in /proc.
#![cfg(target_os = "linux")]

use crate::kit::{Fake, pids, requests};
use noisefloor::ProgressiveSource;
use noisefloor_testkit::{HANG, is_running, require_python, resident_kib};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

pub(crate) fn gone_within(pid: u32, limit: Duration) -> bool {
    let begun = Instant::now();
    while is_running(pid) && begun.elapsed() < limit {
        std::thread::sleep(Duration::from_millis(10));
    }
    !is_running(pid)
}

#[test]
fn no_process_outlives_its_source() {
    for how in ["work", "ignore the end", "hang", "close standard output", "die"] {
        let Some(mut fake) = Fake::new(how) else { return };
        if how == "hang" {
            fake.job.timeout = Duration::from_secs(3);
        }
        let mut source = fake.open().unwrap();
        assert!(is_running(fake.pids()[0]));
        source.sample(&requests(0, 1)).unwrap();
        // Whether it fails is not of interest here
        let _ = source.sample(&requests(1, 1));
        drop(source);
        let left: Vec<u32> = fake.pids().into_iter().filter(|&pid| is_running(pid)).collect();
        assert!(left.is_empty(), "{how}: {left:?}");
    }
}

/// A renderer that forks: its children end with it, whichever way it ends.
#[test]
fn no_child_of_a_renderer_outlives_its_source() {
    for how in ["work", "hang", "die", "ignore the end"] {
        let Some(mut fake) = Fake::new(how) else { return };
        fake.options.insert("fork".to_owned(), "yes".to_owned());
        if how == "hang" {
            fake.job.timeout = Duration::from_secs(3);
        }
        let mut source = fake.open().unwrap();
        let _ = source.sample(&requests(1, 1));
        let pids = two_pids(&fake.folder.path().join("pids"));
        drop(source);
        assert!(pids.len() >= 2, "{how}: {pids:?}");
        assert!(pids.into_iter().all(|pid| gone_within(pid, HANG)), "{how}");
    }
}

/// The renderer's number and that of its child, which comes a little later.
fn two_pids(file: &Path) -> Vec<u32> {
    let begun = Instant::now();
    while pids(file).len() < 2 && begun.elapsed() < HANG {
        std::thread::sleep(Duration::from_millis(10));
    }
    pids(file)
}

/// Not a test: those below run this in a process of its own.
#[test]
#[ignore = "a part of other tests"]
fn the_parent_that_is_killed() {
    let Ok(how) = std::env::var("SIDECAR_TEST_PARENT") else { return };
    let mut fake = Fake::new(&how).unwrap();
    let pids = std::env::var("SIDECAR_TEST_PIDS").unwrap();
    fake.options.insert("pids".to_owned(), pids.clone());
    fake.options.insert("fork".to_owned(), "yes".to_owned());
    let mut source = fake.open().unwrap();
    source.sample(&requests(0, 1)).unwrap();
    two_pids(Path::new(&pids));
    std::fs::write(format!("{pids}.ready"), "").unwrap();
    if std::env::var_os("SIDECAR_TEST_EXIT").is_some() {
        noisefloor_sidecar::end_all();
        std::process::exit(1);
    }
    // Busy for a long time, or idle for one
    let _ = source.sample(&requests(1, 1));
    std::thread::sleep(Duration::from_secs(1000));
}

/// The parent in a process of its own, once its renderer and the renderer's child run.
fn parent(how: &str, folder: &Path, exits: bool) -> (Child, Vec<u32>) {
    let file = folder.join("child pids");
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "life::the_parent_that_is_killed", "--ignored"]).stdout(Stdio::null());
    command.env("SIDECAR_TEST_PARENT", how).env("SIDECAR_TEST_PIDS", &file);
    if exits {
        command.env("SIDECAR_TEST_EXIT", "1");
    }
    let parent = command.spawn().unwrap();
    let ready = folder.join("child pids.ready");
    let begun = Instant::now();
    while !ready.exists() && begun.elapsed() < HANG {
        std::thread::sleep(Duration::from_millis(10));
    }
    let pids = pids(&file);
    assert!(pids.len() == 2, "{how}: {pids:?}");
    (parent, pids)
}

#[test]
fn no_process_outlives_a_killed_parent() {
    for how in ["work", "hang", "ignore the end"] {
        let Some(fake) = Fake::new("work") else { return };
        let (mut parent, pids) = parent(how, fake.folder.path(), false);
        std::thread::sleep(Duration::from_millis(200));
        assert!(pids.iter().all(|&pid| is_running(pid)), "{how}");
        // SIGKILL
        parent.kill().unwrap();
        parent.wait().unwrap();
        for pid in pids {
            assert!(gone_within(pid, HANG), "{how}: process {pid} is left behind");
        }
    }
}

/// `exit` runs no destructor, as after a second Ctrl-C.
#[test]
fn no_process_outlives_an_exit_after_end_all() {
    let Some(fake) = Fake::new("work") else { return };
    let (mut parent, pids) = parent("ignore the end", fake.folder.path(), true);
    assert_eq!(parent.wait().unwrap().code(), Some(1));
    for pid in pids {
        assert!(gone_within(pid, HANG), "process {pid} is left behind");
    }
}

/// Not a test: the one below runs this in a process of its own, whose memory is its own.
#[test]
#[ignore = "a part of another test"]
fn the_parent_that_is_weighed() {
    let fake = Fake::new("work").unwrap();
    let mut source = fake.open().unwrap();
    let mut call = |n: u64| assert_eq!(source.sample(&requests(n, 1)).unwrap().len(), 4);
    (0..100).for_each(&mut call);
    let pids = [std::process::id(), fake.pids()[0]];
    let before = pids.map(resident_kib);
    (100..1100).for_each(&mut call);
    for (before, after) in before.into_iter().zip(pids.map(resident_kib)) {
        // A call moves 23 KB each way: a leak of one in twenty would show
        assert!(after < before + 1024, "{before} KiB before, {after} KiB after 1,000 calls");
    }
}

#[test]
fn memory_is_flat_over_a_thousand_calls() {
    let Some(_) = require_python() else { return };
    let weighed = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "life::the_parent_that_is_weighed", "--ignored", "--nocapture"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&weighed.stdout);
    assert!(weighed.status.success() && said.contains("1 passed"), "{said}");
}
