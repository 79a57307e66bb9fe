use super::*;
use crate::shard::ShardJob;
use noisefloor::{FixedSpp, Params, Session, source::SourceIdentity};

/// How far a frame is does not outlive its job.
#[test]
fn the_state_of_another_job_is_none() {
    let dir = tempfile::tempdir().unwrap();
    let folder = FarmFolder::new(dir.path());
    let job = |seed: &str| {
        let session = Session::new(40, 20, FixedSpp(8), Params::default()).unwrap();
        let shards = ShardJob::of(SourceIdentity::new(seed), &session);
        FrameJob { scene: "bulb".into(), source: "ptwne".into(), shards, waits: false }
    };
    let done = FrameState { done: true, ..FrameState::default() };
    folder.write_frame_job("frame", &job("seed 1")).unwrap();
    folder.write_state("frame", &done).unwrap();
    assert_eq!(folder.state("frame").unwrap(), done);
    folder.write_frame_job("frame", &job("seed 2")).unwrap();
    assert_eq!(folder.state("frame").unwrap(), FrameState::default());
}

/// A plan of another release is refused by its version, and not by what it lacks.
#[test]
fn plans_of_other_releases_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let folder = FarmFolder::new(dir.path());
    folder.write_plan(&FarmPlan::new("a job".to_owned(), None, 16, false)).unwrap();
    assert_eq!(folder.plan::<String>().unwrap().job, "a job");
    for (text, found) in [(r#"{"arguments": ["bulb"], "frames": null}"#, "1"), (r#"{"version": 9}"#, "9")] {
        std::fs::write(dir.path().join("farm.json"), text).unwrap();
        let said = folder.plan::<String>().unwrap_err().to_string();
        assert!(
            said.contains(&format!("format version {found}")) && said.contains("plan the farm anew"),
            "{said}"
        );
    }
}
