use super::*;
use noisefloor::{FixedSpp, Params};

fn job() -> ShardJob {
    let session = Session::new(40, 24, FixedSpp(8), Params::default().with_tile(16)).unwrap();
    ShardJob::of(SourceIdentity::new("grey"), &session)
}

fn shard() -> Shard {
    let mut shard = Shard::new(job()).with_render(&"bulb");
    shard.add(PlannedBatch::new(0, 0, 4), 4, vec![[0.25, f32::NAN, -1.5]; 256]);
    shard.add(PlannedBatch::new(5, 4, 4), 2, vec![[1e-40, 3.0, f32::MAX]; 64]);
    shard.add(PlannedBatch::new(1, 8, 4), 0, vec![]);
    shard.add_seconds(1.5);
    shard
}

#[test]
fn what_is_written_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nfs");
    shard().write(&path).unwrap();
    let file = ShardFile::open(&path).unwrap();
    assert_eq!(
        (file.job(), file.render::<String>().unwrap(), file.seconds()),
        (&job(), "bulb".to_owned(), 1.5)
    );
    assert_eq!(
        file.batches().iter().map(|b| (b.tile, b.first, b.asked, b.spp)).collect::<Vec<_>>(),
        [(0, 0, 4, 4), (5, 4, 4, 2), (1, 8, 4, 0)]
    );
    let first = file.read(0).unwrap();
    assert!(first.len() == 256 && first[7][1].is_nan() && first[7][2] == -1.5);
    assert_eq!(file.read(1).unwrap(), vec![[1e-40, 3.0, f32::MAX]; 64]);
    assert!(file.read(2).unwrap().is_empty());
}

/// Cut short anywhere, or with any byte changed, it is refused, and what is read is right.
#[test]
fn damage_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let (path, bad) = (folder.path().join("a.nfs"), folder.path().join("b.nfs"));
    shard().write(&path).unwrap();
    let whole = std::fs::read(&path).unwrap();
    for length in (0..whole.len()).step_by(13) {
        std::fs::write(&bad, &whole[..length]).unwrap();
        let error = ShardFile::open(&bad).unwrap_err();
        assert!(matches!(error, ShardError::Foreign | ShardError::Damaged(_)), "{length}: {error}");
    }
    for at in (0..whole.len()).step_by(7) {
        let mut changed = whole.clone();
        changed[at] ^= 0x40;
        std::fs::write(&bad, &changed).unwrap();
        let read = ShardFile::open(&bad).and_then(|file| file.read(0).and(file.read(1)));
        assert!(read.is_err(), "byte {at} of {}", whole.len());
    }
}

/// A file that announces more than it has reserves no memory for it.
#[test]
fn announced_lengths_are_limited() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nfs");
    for (length, word) in [(u64::MAX, "limit"), (MAX_HEADER, "ends before")] {
        let parts = [&FORMAT.magic[..], &VERSION.to_le_bytes(), &length.to_le_bytes(), &[0; 32], b"{}"];
        std::fs::write(&path, parts.concat()).unwrap();
        let error = ShardFile::open(&path).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn another_version_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nfs");
    std::fs::write(&path, [&FORMAT.magic[..], &9u32.to_le_bytes(), &[0; 40]].concat()).unwrap();
    assert!(matches!(ShardFile::open(&path), Err(ShardError::Version(9))));
}

/// Plans are short, and are read again as they are.
#[test]
fn plans_are_lists_of_numbers() {
    let plan =
        [PlannedBatch::new(3, 8, 4), PlannedBatch { sequence: 1, point: 2, ..PlannedBatch::new(1, 8, 4) }];
    let text = serde_json::to_string(&plan).unwrap();
    assert_eq!(text, "[[3,8,4,0,8],[1,8,4,1,2]]");
    assert_eq!(serde_json::from_str::<Vec<PlannedBatch>>(&text).unwrap(), plan);
}
