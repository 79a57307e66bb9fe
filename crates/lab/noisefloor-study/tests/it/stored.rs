use crate::kit::{Folder, Running, levels, public};
use noisefloor_study::simulated::drive;
use noisefloor_study::{Plan, SessionRecord, StoreError, Study, grids, replay, store};
use rusqlite::Connection;
use std::sync::Arc;

/// Databases of 2026-11-23, before trials were stored, as SQL: two simulated observers each; and what came of
/// their trials then.
const STORED: [[&str; 3]; 3] = [
    ["acquisition", include_str!("stored/acquisition.sql"), include_str!("stored/acquisition.txt")],
    ["validation", include_str!("stored/validation.sql"), include_str!("stored/validation.txt")],
    ["forced-choice", include_str!("stored/forced-choice.sql"), include_str!("stored/forced-choice.txt")],
];

fn folder(protocol: &str) -> Folder {
    Folder::new(protocol, &["wall", "door"], &levels(6, 2.0), "trials = 3\nrepeats = 2\nseed = 77\n")
}

fn read(study: &Study) -> Vec<SessionRecord> {
    store::read_all(&study.database, &study.design()).unwrap()
}

fn outcomes(study: &Arc<Study>, record: &SessionRecord) -> String {
    let session = replay(study.clone(), grids(study), record).unwrap();
    format!("{} {:?} {:?}\n", record.code, session.stage(), session.outcomes())
}

fn rows(study: &Study, sql: &str) {
    Connection::open(&study.database).unwrap().execute_batch(sql).unwrap();
}

/// Answers keep their meaning, whatever becomes of the random generator: before and after a server has stored
/// the trials that the old one drew.
#[test]
fn answers_of_an_earlier_version_mean_what_they_meant() {
    for [protocol, sql, expected] in STORED {
        let folder = folder(protocol);
        let study = folder.study();
        rows(&study, &format!("PRAGMA foreign_keys=OFF;\n{sql}"));
        let before = read(&study);
        assert!(before.iter().all(|record| record.plan.is_none()), "{protocol}");
        assert_eq!(before.iter().map(|r| outcomes(&study, r)).collect::<String>(), expected, "{protocol}");
        drop(Running::start(study.clone()));
        let after = read(&study);
        for record in &after {
            assert_eq!(record.plan, Some(Plan::draw(&study, record.seed)), "{protocol}");
        }
        assert_eq!(after.iter().map(|r| outcomes(&study, r)).collect::<String>(), expected, "{protocol}");
    }
}

/// The stored trials count, not what the seed would draw today: another seed beside them changes nothing.
/// Trials of another study are refused.
#[test]
fn a_session_is_replayed_with_the_trials_that_were_shown() {
    let folder = folder("forced-choice");
    let study = folder.study();
    let server = Running::start(study.clone());
    drive(&server.url, "", &mut public(2, &[60.0, 90.0]).draw(2), |_| ()).unwrap();
    drop(server);
    let expected = outcomes(&study, &read(&study)[0]);
    rows(&study, "UPDATE sessions SET seed = seed + 1");
    let record = &read(&study)[0];
    assert_ne!(record.plan, Some(Plan::draw(&study, record.seed)));
    assert_eq!(outcomes(&study, record), expected);
    let mut without = record.clone();
    without.plan = None;
    // What the seed draws instead, the answers do not fit, or mean something else
    let drawn = replay(study.clone(), grids(&study), &without);
    assert!(drawn.is_err() || outcomes(&study, &without) != expected);

    rows(&study, r#"UPDATE plans SET plan = replace(plan, '"tile":1', '"tile":9')"#);
    let refused = replay(study.clone(), grids(&study), &read(&study)[0]).unwrap_err();
    assert!(matches!(refused, StoreError::Plan { .. }), "{refused}");
    rows(&study, "UPDATE plans SET plan = '{}'");
    let refused = store::read_all(&study.database, &study.design()).unwrap_err();
    assert!(matches!(refused, StoreError::Plan { .. }), "{refused}");
}
