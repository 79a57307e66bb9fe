use crate::kit::{Folder, Running, levels, public};
use noisefloor_study::simulated::drive;
use noisefloor_study::{Plan, SessionRecord, StoreError, Study, grids, replay, store};
use rusqlite::Connection;
use std::sync::Arc;

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

/// The stored trials count, not what the seed would draw today: another seed beside them changes nothing.
/// Trials of another study are refused.
#[test]
fn a_session_is_replayed_with_the_trials_that_were_shown() {
    let folder = Folder::new("forced-choice", &["wall", "door"], &levels(6, 2.0), "trials = 3\n");
    let study = folder.study();
    let server = Running::start(study.clone());
    drive(&server.url, "", &mut public(2, &[60.0, 90.0]).draw(2), |_| ()).unwrap();
    drop(server);
    let expected = outcomes(&study, &read(&study)[0]);
    rows(&study, "UPDATE sessions SET seed = seed + 1");
    let record = &read(&study)[0];
    assert_ne!(record.plan, Plan::draw(&study, record.seed));
    assert_eq!(outcomes(&study, record), expected);
    // What the seed draws instead, the answers do not fit, or mean something else
    let other = SessionRecord { plan: Plan::draw(&study, record.seed), ..record.clone() };
    assert!(replay(study.clone(), grids(&study), &other).is_err() || outcomes(&study, &other) != expected);

    rows(&study, r#"UPDATE plans SET plan = replace(plan, '"tile":1', '"tile":9')"#);
    let refused = replay(study.clone(), grids(&study), &read(&study)[0]).unwrap_err();
    assert!(matches!(refused, StoreError::Plan { .. }), "{refused}");
    rows(&study, "UPDATE plans SET plan = '{}'");
    let refused = store::read_all(&study.database, &study.design()).unwrap_err();
    assert!(matches!(refused, StoreError::Plan { .. }), "{refused}");
    rows(&study, "PRAGMA user_version = 2");
    let refused = store::read_all(&study.database, &study.design()).unwrap_err();
    assert!(refused.to_string().contains("another study"), "{refused}");
}
