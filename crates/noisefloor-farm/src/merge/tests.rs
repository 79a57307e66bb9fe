use super::*;
use crate::{Shard, sample, split};
use noisefloor::{
    Batch, Driver, Oracle, Params, ProgressiveSource, Repeats, Schedule, SourceError, SourceInfo,
    source::SourceIdentity,
};
use noisefloor_testkit::Noise;
use proptest::prelude::*;
use std::fs;
use tempfile::{TempDir, tempdir};

/// A wall with much noise on its right side, as a path tracer might see it.
struct Wall {
    seed: u64,
}

impl ProgressiveSource for Wall {
    fn info(&self) -> SourceInfo {
        SourceInfo::new("wall", 80, 48).with_repeats(Repeats::Samples)
    }

    fn identity(&self) -> Result<SourceIdentity, SourceError> {
        Ok(SourceIdentity::new(format!("wall, seed {}", self.seed)))
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let batch = |r: &Request| Batch::new(r.tile, r.spp, self.mean(r));
        Ok(requests.iter().map(batch).collect())
    }
}

impl Wall {
    fn mean(&self, &Request { tile, spp, sequence, .. }: &Request) -> Vec<Rgb> {
        let mut mean = Vec::new();
        for pixel in 0..tile.pixels() {
            let (x, y) = (tile.x + pixel % tile.width, tile.y + pixel / tile.width);
            // Sums of pairs of samples would do as well; a mean has the noise of its number of samples
            let noise =
                Noise::keyed(&[self.seed, x as u64, y as u64, sequence.number.into(), sequence.first, spp])
                    .normal() as f32;
            let deviation = 0.004 * x as f32 / (spp as f32).sqrt();
            mean.push([0.3 + deviation * noise; 3]);
        }
        mean
    }
}

fn params(spaced: bool) -> Params {
    let schedule = if spaced { Schedule::Spaced { step: 10 } } else { Schedule::Every { step: 10 } };
    Params::default().with_tile(32).with_schedule(schedule).with_min_spp(10).with_max_spp(200)
}

fn session(spaced: bool) -> Session<Oracle> {
    let mut session = Session::new(80, 48, Oracle::bundled(), params(spaced)).unwrap();
    session.set_source(Wall { seed: 3 }.identity().unwrap());
    session.set_linear();
    session
}

/// Picture and all decisions, as the bytes of a checkpoint.
fn outcome(session: &Session<Oracle>) -> Vec<u8> {
    let mut bytes = Vec::new();
    session.checkpoint("farm").unwrap().write(&mut bytes).unwrap();
    bytes
}

fn one_machine(spaced: bool) -> Vec<u8> {
    let mut driver = Driver::new(Wall { seed: 3 }, Oracle::bundled(), params(spaced)).unwrap();
    driver.run(|_, _| ()).unwrap();
    outcome(driver.session())
}

/// A folder of shards with all that a session wants next, in random pieces.
struct Pieces {
    folder: TempDir,
    random: fastrand::Rng,
    count: usize,
}

impl Pieces {
    fn new(seed: u64) -> Self {
        Self { folder: tempdir().unwrap(), random: fastrand::Rng::with_seed(seed), count: 0 }
    }

    fn write(&mut self, job: &ShardJob, batches: &[PlannedBatch]) -> PathBuf {
        self.count += 1;
        let path = self.folder.path().join(format!("{}-{}.nfs", self.random.u32(..), self.count));
        let shard = sample(&mut Wall { seed: 3 }, job.clone(), batches, || false).unwrap();
        shard.write(&path).unwrap();
        path
    }

    fn render(&mut self, job: &ShardJob, session: &Session<Oracle>, shards: &ShardSet) {
        let mut wanted = PlannedBatch::ahead(session);
        wanted.retain(|batch| !shards.has(batch));
        self.random.shuffle(&mut wanted);
        while !wanted.is_empty() {
            let some = wanted.split_off(wanted.len() - self.random.usize(1..=wanted.len().min(5)));
            self.write(job, &some);
        }
    }

    fn paths(&mut self) -> Vec<PathBuf> {
        let mut paths: Vec<_> =
            fs::read_dir(self.folder.path()).unwrap().map(|e| e.unwrap().path()).collect();
        self.random.shuffle(&mut paths);
        paths
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// However work is split, in whatever order and after how many interruptions shards are
    /// merged: picture, stops and all else are those of `Driver` on one machine, to the bit.
    #[test]
    fn shards_give_the_picture_of_one_machine(seed: u64, spaced: bool) {
        let begin = || session(spaced);
        let mut pieces = Pieces::new(seed);
        let mut farm = begin();
        let job = ShardJob::of(Wall { seed: 3 }.identity().unwrap(), &farm);
        while !farm.is_done() {
            let all = ShardSet::gather(&job, &pieces.paths());
            pieces.render(&job, &farm, &all);
            // Some at first, then all
            let paths = pieces.paths();
            for known in [pieces.random.usize(0..=paths.len()), paths.len()] {
                ShardSet::gather(&job, &paths[..known]).merge_into(&mut farm).unwrap();
                let checkpoint = farm.checkpoint("farm").unwrap();
                farm = begin().resume("farm", checkpoint).unwrap();
            }
            let mut all = ShardSet::gather(&job, &paths);
            let again = all.merge_into(&mut farm).unwrap();
            prop_assert_eq!(again, Merged::default(), "a merge repeated adds something");
            prop_assert!(all.problems().is_empty(), "{:?}", all.problems());
        }
        prop_assert!(outcome(&farm) == one_machine(spaced));
        // From scratch, too
        let mut whole = begin();
        let mut shards = ShardSet::gather(&job, &pieces.paths());
        let merged = shards.merge_into(&mut whole).unwrap();
        prop_assert!(outcome(&whole) == outcome(&farm) && shards.problems().is_empty());
        let taken: u64 = shards.files().iter().map(ShardFile::samples).sum();
        prop_assert!(merged.samples == whole.film().total_samples() && merged.samples <= taken);
        // Nothing is taken ahead of the verdicts that share it out
        prop_assert_eq!(merged.samples, taken);
    }
}

/// Whatever is wrong is named, none of it is mixed in, and the rest is merged.
#[test]
fn what_is_wrong_is_named_and_never_mixed_in() {
    let mut farm = session(false);
    let job = ShardJob::of(Wall { seed: 3 }.identity().unwrap(), &farm);
    let mut pieces = Pieces::new(1);
    while !farm.is_done() {
        let there = ShardSet::gather(&job, &pieces.paths());
        pieces.render(&job, &farm, &there);
        ShardSet::gather(&job, &pieces.paths()).merge_into(&mut farm).unwrap();
    }
    let good = pieces.paths();
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let wrong_light = |name: &str, job: ShardJob, batch: (usize, u64, u64)| {
        let mut shard = Shard::new(job);
        let (tile, first, spp) = batch;
        shard.add(PlannedBatch::new(tile, first, spp), spp, vec![[9.0; 3]; 32 * 32]);
        shard.write(path(name)).unwrap();
    };

    // Damaged in its samples and cut short: of batches that other shards have, too
    let again = pieces.write(&job, &[PlannedBatch::new(0, 0, 5), PlannedBatch::new(1, 0, 5)]);
    fs::copy(&again, path("doubled.nfs")).unwrap();
    let mut bytes = fs::read(&again).unwrap();
    fs::remove_file(&again).unwrap();
    fs::write(path("cut.nfs"), &bytes[..bytes.len() - 1]).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(path("damaged.nfs"), &bytes).unwrap();
    fs::write(path("rubbish.nfs"), b"no space left on device").unwrap();
    // Of other jobs, and of ranges that are there
    let other = SourceIdentity::new("wall, seed 4");
    wrong_light("seed.nfs", ShardJob { source: other, ..job.clone() }, (0, 0, 5));
    wrong_light("size.nfs", ShardJob { width: 96, ..job.clone() }, (0, 0, 5));
    let mut others = job.params.clone();
    others["max_spp"] = 7.into();
    wrong_light("params.nfs", ShardJob { params: others, ..job.clone() }, (0, 0, 5));
    wrong_light("overlap.nfs", job.clone(), (0, 2, 6));

    let names = ["damaged", "doubled", "cut", "rubbish", "seed", "size", "params", "overlap"];
    let bad: Vec<PathBuf> = names.iter().map(|name| path(&format!("{name}.nfs"))).collect();
    let mut merged = session(false);
    let mut shards = ShardSet::gather(&job, &[&bad[..], &good].concat());
    shards.merge_into(&mut merged).unwrap();
    shards.find_overlaps(&merged);
    assert!(outcome(&merged) == one_machine(false));
    let said: Vec<String> = shards.problems().iter().map(ToString::to_string).collect();
    for (name, word) in [
        ("damaged", "checksum of tile 1 from sample 0 on differs"),
        ("doubled", "too (tile 1, samples 0 to 5): taken once"),
        ("cut", "is cut short"),
        ("rubbish", "not a shard"),
        ("seed", "it is of wall, seed 4, not of wall, seed 3"),
        ("size", "its picture is 96×48 in tiles of 32, not 80×48"),
        ("params", "its max_spp is 7, not "),
        ("overlap", "overlaps samples of other shards in tile 0, samples 2 to 8"),
    ] {
        let named = said.iter().any(|line| line.contains(&format!("{name}.nfs: ")) && line.contains(word));
        assert!(named, "{name}: {word:?} is not in\n{}", said.join("\n"));
    }

    // Two that contradict each other: neither is used, and what is missing keeps the tile open
    wrong_light("liar.nfs", job.clone(), (0, 0, 5));
    let mut open = session(false);
    let mut shards = ShardSet::gather(&job, &[&good[..], &[path("liar.nfs")]].concat());
    shards.merge_into(&mut open).unwrap();
    assert!(shards.problems().iter().filter(|p| p.what.contains("contradicts") && p.useless).count() == 2);
    assert_eq!(open.film().spp(0), 0);
}

/// Nothing of a shard is needed once its tiles are done or have its samples.
#[test]
fn shards_are_used_up() {
    let mut farm = session(false);
    let job = ShardJob::of(Wall { seed: 3 }.identity().unwrap(), &farm);
    let mut pieces = Pieces::new(2);
    let tasks = split(vec![(job.grid().unwrap(), PlannedBatch::ahead(&farm))], 1);
    pieces.write(&job, &tasks[0].batches);
    pieces.write(&job, &[PlannedBatch::new(0, 1000, 5)]);
    let mut shards = ShardSet::gather(&job, &pieces.paths());
    assert!(shards.used_up(&farm).is_empty());
    let merged = shards.merge_into(&mut farm).unwrap();
    assert_eq!((merged.samples, merged.rounds), (10 * 80 * 48, 1));
    assert_eq!(shards.used_up(&farm).len(), if farm.is_open(0) { 1 } else { 2 });
}
