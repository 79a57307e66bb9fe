use super::*;
use noisefloor::{FixedSpp, Params, Session, source::SourceIdentity};

#[test]
fn what_could_not_be_read_back_is_not_written() {
    let mut text = Vec::new();
    let mut to = UpTo { to: &mut text, left: 4 };
    to.write_all(b"ab").unwrap();
    assert_eq!(to.write_all(b"cde").unwrap_err().kind(), io::ErrorKind::FileTooLarge);
    to.write_all(b"cd").unwrap();
    assert_eq!(text, b"abcd");
}

/// How far a frame is does not outlive its job.
#[test]
fn the_state_of_another_job_is_none() {
    let dir = tempfile::tempdir().unwrap();
    let folder = FarmFolder::new(dir.path());
    let job = |seed: &str| {
        let session = Session::new(40, 20, FixedSpp(8), Params::default()).unwrap();
        let shards = ShardJob::of(SourceIdentity::new(seed), &session);
        FrameJob { scene: "bulb".into(), source: "ptwne".into(), shards }
    };
    let done = FrameState { done: true, ..FrameState::default() };
    folder.write_frame_job("frame", &job("seed 1")).unwrap();
    folder.write_state("frame", &done).unwrap();
    assert_eq!(folder.state("frame").unwrap(), done);
    folder.write_frame_job("frame", &job("seed 2")).unwrap();
    assert_eq!(folder.state("frame").unwrap(), FrameState::default());
}
