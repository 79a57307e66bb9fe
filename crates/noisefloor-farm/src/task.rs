//! Taking the samples of a shard.

use crate::error::FarmError;
use crate::shard::{Shard, ShardJob};
use noisefloor::{LightCheck, ProgressiveSource, Request, SourceError};
use std::time::Instant;

/// Most samples of one call, over all pixels: as on one machine, so that cancelling is prompt.
const CALL: u64 = 1 << 22;

/// Takes the batches (tile, first sample, samples) from a source. Once `cancel` says so, it returns with what
/// it has: that is a shard, too.
///
/// # Errors
/// [`FarmError::Edited`] if the source is not that of `job`, [`FarmError::Source`] if it fails or breaks its
/// contract, or a batch is no light.
pub fn sample(
    source: &mut impl ProgressiveSource,
    job: ShardJob,
    batches: &[(usize, u64, u64)],
    cancel: impl Fn() -> bool,
) -> Result<Shard, FarmError> {
    let info = source.info();
    let now = ShardJob { source: source.identity()?, width: info.width, height: info.height, ..job.clone() };
    now.check(&job).map_err(FarmError::Edited)?;
    let grid = job.grid().map_err(FarmError::Edited)?;
    let broken = |what| FarmError::Source(SourceError::Contract { name: info.name.clone(), what });
    let mut requests = Vec::new();
    for &(tile, first, spp) in batches {
        if tile >= grid.len() || spp == 0 {
            return Err(broken(format!("it was asked for {spp} samples of tile {tile}")));
        }
        requests.push(Request { tile: grid.tile(tile), first, spp });
    }
    // So that different tiles share calls
    requests.sort_by_key(|request| request.first);

    let (mut shard, mut light) = (Shard::new(job), LightCheck::default());
    while !requests.is_empty() && !cancel() {
        let call = next_call(&mut requests);
        let began = Instant::now();
        let given = source.sample(&call)?;
        shard.add_seconds(began.elapsed().as_secs_f64());
        if given.len() != call.len() {
            return Err(broken(format!("{} batches for {} requests", given.len(), call.len())));
        }
        for (request, batch) in call.iter().zip(given) {
            let index = request.tile.index;
            let pixels = if batch.spp == 0 { 0 } else { request.tile.pixels() };
            let fits = batch.tile == request.tile && batch.mean.len() == pixels;
            if !fits || batch.spp > info.counts.most(request) {
                let (pixels, spp) = (batch.mean.len(), batch.spp);
                return Err(broken(format!("{pixels} pixels of {spp} samples for tile {index}")));
            }
            let lit = if pixels == 0 { Ok(()) } else { light.check(&batch.mean) };
            lit.map_err(|error| broken(format!("in tile {index}, {error}")))?;
            shard.add(index, request.first, request.spp, batch.spp, batch.mean);
        }
    }
    Ok(shard)
}

/// The next batches of different tiles, as many as one call may have.
fn next_call(requests: &mut Vec<Request>) -> Vec<Request> {
    let mut samples = 0;
    let mut call: Vec<Request> = Vec::new();
    for request in requests.iter() {
        samples += request.spp * request.tile.pixels() as u64;
        let again = call.iter().any(|other| other.tile.index == request.tile.index);
        if !call.is_empty() && (again || samples > CALL) {
            break;
        }
        call.push(*request);
    }
    requests.drain(..call.len());
    call
}
