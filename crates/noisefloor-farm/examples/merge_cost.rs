//! What a merge costs: `merge_cost FOLDER WIDTH HEIGHT SHARDS LAYERS` writes LAYERS batches of every tile into
//! SHARDS shards of seeded noise, merges them, and says how long that took and how much memory it had.
//! docs/benchmarks/farm.md has the numbers.
#![allow(clippy::print_stdout, reason = "its output is its purpose")]

use noisefloor::{Oracle, Params, Schedule, Session, source::SourceIdentity};
use noisefloor_farm::{PlannedBatch, Shard, ShardJob, ShardSet};
use noisefloor_testkit::Noise;
use std::path::PathBuf;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [folder, width, height, shards, layers] = &args[..] else {
        return Err("FOLDER WIDTH HEIGHT SHARDS LAYERS".into());
    };
    let folder = PathBuf::from(folder);
    let (width, height, count, layers): (usize, usize, usize, u64) =
        (width.parse()?, height.parse()?, shards.parse()?, layers.parse()?);

    // One verdict, at the end, since the cost of verdicts is known
    let most = layers * 16;
    let schedule = Schedule::Every { step: most };
    let params = Params::default().with_schedule(schedule).with_min_spp(most).with_max_spp(most);
    let mut session = Session::new(width, height, Oracle::bundled(), params)?;
    let job = ShardJob::of(SourceIdentity::new("noise"), &session);

    let began = Instant::now();
    let (batches, grid) = (PlannedBatch::ahead(&session), job.grid()?);
    let mut random = Noise::keyed(&[1]);
    let noise: Vec<[f32; 3]> = (0..128 * 128 + 977).map(|_| [random.uniform() as f32; 3]).collect();
    let (mut paths, mut bytes) = (Vec::new(), 0);
    for (index, some) in batches.chunks(batches.len().div_ceil(count)).enumerate() {
        let mut shard = Shard::new(job.clone());
        for batch in some {
            let start = (batch.first as usize * 31 + batch.tile) % 977;
            let mean = noise[start..start + grid.tile(batch.tile).pixels()].to_vec();
            shard.add(batch.clone(), batch.spp, mean);
        }
        let path = folder.join(format!("{index:05}.nfs"));
        shard.write(&path)?;
        bytes += std::fs::metadata(&path)?.len();
        paths.push(path);
    }
    let wrote = began.elapsed().as_secs_f64();

    let began = Instant::now();
    let mut set = ShardSet::gather(&job, &paths);
    let gathered = began.elapsed().as_secs_f64();
    let merged = set.merge_into(&mut session)?;
    let seconds = began.elapsed().as_secs_f64();
    let pixels = (width * height) as f64;
    let began = Instant::now();
    session.checkpoint("merge")?.write(std::fs::File::create(folder.join("checkpoint.nfc"))?)?;
    println!(
        "{width}x{height}, {} shards, {} batches, {:.2} GB: written in {wrote:.1} s; headers {gathered:.2} s, \
         merge {seconds:.1} s ({:.1} ns per pixel and batch), checkpoint {:.1} s, {:.0} MB resident ({:.0} bytes per pixel)",
        paths.len(),
        merged.batches,
        bytes as f64 / 1e9,
        seconds * 1e9 / (pixels * merged.batches as f64 / session.film().grid().len() as f64),
        began.elapsed().as_secs_f64(),
        peak() / 1e6,
        peak() / pixels,
    );
    assert!(session.is_done(), "batches are missing");
    Ok(())
}

/// Most bytes that were resident; 0 where the system does not tell.
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    let kib = line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok());
    kib.unwrap_or(0.0) * 1024.0
}
