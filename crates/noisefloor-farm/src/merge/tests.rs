use super::*;
use crate::{Shard, sample, split};
use noisefloor::{
    Batch, Counts, Driver, Oracle, Params, ProgressiveSource, Repeats, Schedule, SourceError, SourceIdentity,
    SourceInfo, Stop, Unit,
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
        let (unit, repeats) = (Unit::SamplesPerPixel, Repeats::Samples);
        let name = "wall".into();
        SourceInfo { name, width: 80, height: 48, unit, aims: true, repeats, counts: Counts::Asked }
    }

    fn identity(&self) -> Result<SourceIdentity, SourceError> {
        Ok(SourceIdentity::new(format!("wall, seed {}", self.seed)))
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let mut batches = Vec::new();
        for &Request { tile, first, spp } in requests {
            let mut mean = Vec::new();
            for (x, y) in (tile.y..tile.y + tile.height)
                .flat_map(|y| (tile.x..tile.x + tile.width).map(move |x| (x, y)))
            {
                // Sums of pairs of samples would do as well; a mean has the noise of its number of samples
                let noise = Noise::keyed(&[self.seed, x as u64, y as u64, first, spp]).normal() as f32;
                let deviation = 0.004 * x as f32 / (spp as f32).sqrt();
                mean.push([0.3 + deviation * noise; 3]);
            }
            batches.push(Batch { tile, spp, mean });
        }
        Ok(batches)
    }
}

fn params(spaced: bool) -> Params {
    let schedule = if spaced { Schedule::Spaced { step: 10 } } else { Schedule::Every { step: 10 } };
    Params { tile: 32, schedule, min_spp: 10, max_spp: 200, ..Params::default() }
}

fn session(spaced: bool) -> Session<Oracle> {
    Session::new(80, 48, Oracle::bundled(), params(spaced)).unwrap()
}

fn outcome(session: &Session<Oracle>) -> (Vec<u32>, Vec<Stop>, Option<f32>) {
    let bits = session.film().image().as_flattened().iter().map(|v| v.to_bits()).collect();
    (bits, session.stops().collect(), session.display().map(|display| display.exposure()))
}

fn one_machine(spaced: bool) -> (Vec<u32>, Vec<Stop>, Option<f32>) {
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

    fn write(&mut self, job: &ShardJob, batches: &[(usize, u64, u64)]) -> PathBuf {
        self.count += 1;
        let path = self.folder.path().join(format!("{}-{}.nfs", self.random.u32(..), self.count));
        let shard = sample(&mut Wall { seed: 3 }, job.clone(), batches, || false).unwrap();
        shard.write(&path).unwrap();
        path
    }

    fn render(&mut self, job: &ShardJob, session: &Session<Oracle>, shards: &ShardSet) {
        let mut wanted: Vec<(usize, u64, u64)> = (0..6)
            .flat_map(|tile| session.batches_ahead(tile))
            .filter(|batch| !shards.has(batch))
            .map(|batch| (batch.tile.index, batch.first, batch.spp))
            .collect();
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

    /// However work is split, in whatever order and after how many interruptions shards are merged, picture,
    /// stops and exposure are those of `Driver` on one machine, to the bit.
    #[test]
    fn shards_give_the_picture_of_one_machine(seed: u64, spaced: bool) {
        let mut pieces = Pieces::new(seed);
        let mut farm = session(spaced);
        let job = ShardJob::of(Wall { seed: 3 }.identity().unwrap(), &farm);
        while !farm.is_done() {
            let all = ShardSet::gather(&job, &pieces.paths());
            pieces.render(&job, &farm, &all);
            // Some at first, then all
            let paths = pieces.paths();
            for known in [pieces.random.usize(0..=paths.len()), paths.len()] {
                ShardSet::gather(&job, &paths[..known]).merge_into(&mut farm).unwrap();
                let checkpoint = farm.checkpoint("farm");
                farm = session(spaced).resume("farm", checkpoint).unwrap();
            }
            let again = ShardSet::gather(&job, &paths).merge_into(&mut farm).unwrap();
            prop_assert_eq!(again, Merged::default(), "a merge repeated adds something");
        }
        prop_assert!(outcome(&farm) == one_machine(spaced));
        // From scratch, too
        let mut whole = session(spaced);
        let mut shards = ShardSet::gather(&job, &pieces.paths());
        shards.merge_into(&mut whole).unwrap();
        prop_assert!(outcome(&whole) == outcome(&farm) && shards.problems().is_empty());
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
        shard.add(batch.0, batch.1, batch.2, batch.2, vec![[9.0; 3]; 32 * 32]);
        shard.write(path(name)).unwrap();
    };

    // Damaged in its samples and cut short: of batches that other shards have, too
    let again = pieces.write(&job, &[(0, 0, 5), (1, 0, 5)]);
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
    wrong_light("params.nfs", ShardJob { params: "others".into(), ..job.clone() }, (0, 0, 5));
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
        ("params", "its set of parameters is others"),
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
    let tasks = split((0..6).flat_map(|tile| farm.batches_ahead(tile)).map(|b| (0, b)).collect(), 1);
    pieces.write(&job, &tasks[0].batches);
    pieces.write(&job, &[(0, 1000, 5)]);
    let mut shards = ShardSet::gather(&job, &pieces.paths());
    assert!(shards.used_up(&farm).is_empty());
    let merged = shards.merge_into(&mut farm).unwrap();
    assert_eq!((merged.samples, merged.rounds), (10 * 80 * 48, 1));
    assert_eq!(shards.used_up(&farm).len(), if farm.is_open(0) { 1 } else { 2 });
}
