//! Taking the samples of a shard.

use crate::batch::PlannedBatch;
use crate::error::FarmError;
use crate::shard::{Shard, ShardJob};
use noisefloor::{Batch, ProgressiveSource, Request, SourceError, SourceInfo, Tile, watch::LightCheck};
use std::time::Instant;

/// Most samples of one call, over all pixels: as on one machine, so that cancelling is prompt.
const CALL: u64 = 1 << 22;

/// A batch, and the request that asks for it.
type Wanted<'a> = (Request, &'a PlannedBatch);

/// Samples per pixel that no tile has.
const COUNTABLE: u64 = 1 << 34;

/// Whether a plan can have asked for this: its batches are those of [`Session::next_batches`], which fit
/// into one call. A damaged plan must not keep a node busy for a year.
///
/// [`Session::next_batches`]: noisefloor::Session::next_batches
fn is_planned(batch: &PlannedBatch, tile: Tile) -> bool {
    let &PlannedBatch { first, spp, sequence, point, .. } = batch;
    let pixels = tile.pixels() as u64;
    let fits = spp > 0 && spp.saturating_mul(pixels) <= CALL.max(pixels);
    fits && first < COUNTABLE && sequence < 2 && point <= first
}

/// Takes these batches from a source. Once `cancel` says so, it returns with what it has: that is a shard,
/// too.
///
/// # Errors [`FarmError::Edited`] if the source is not that of `job`, [`FarmError::Plan`] if no plan asks for
/// such a batch, [`FarmError::Source`] if it fails or breaks its contract, or a batch is no light.
pub fn sample(
    source: &mut impl ProgressiveSource,
    job: ShardJob,
    batches: &[PlannedBatch],
    cancel: impl Fn() -> bool,
) -> Result<Shard, FarmError> {
    let info = source.info();
    let now = ShardJob { source: source.identity()?, width: info.width, height: info.height, ..job.clone() };
    now.check(&job).map_err(FarmError::Edited)?;
    let grid = job.grid().map_err(FarmError::Edited)?;
    let mut wanted: Vec<Wanted<'_>> = Vec::new();
    for batch in batches {
        let &PlannedBatch { tile, first, spp, .. } = batch;
        if tile >= grid.len() || !is_planned(batch, grid.tile(tile)) {
            return Err(FarmError::Plan { tile, first, spp });
        }
        wanted.push((batch.request(grid.tile(tile)), batch));
    }
    // So that different tiles share calls
    wanted.sort_by_key(|(request, _)| request.first);

    let (mut shard, mut light) = (Shard::new(job), LightCheck::default());
    while !wanted.is_empty() && !cancel() {
        let call = next_call(&mut wanted);
        let began = Instant::now();
        let requests: Vec<Request> = call.iter().map(|(request, _)| *request).collect();
        let given = source.sample(&requests)?;
        shard.add_seconds(began.elapsed().as_secs_f64());
        if given.len() != call.len() {
            return Err(broken(&info, format!("{} batches for {} requests", given.len(), call.len())));
        }
        for ((request, planned), batch) in call.into_iter().zip(given) {
            check(&info, &request, &batch)?;
            let lit = if batch.spp == 0 { Ok(()) } else { light.check(&batch.mean) };
            lit.map_err(|error| broken(&info, format!("in tile {}, {error}", request.tile.index)))?;
            shard.add(planned.clone(), batch.spp, batch.mean);
        }
    }
    Ok(shard)
}

/// Checks that a batch is of what was asked for.
fn check(info: &SourceInfo, request: &Request, batch: &Batch) -> Result<(), FarmError> {
    let pixels = if batch.spp == 0 { 0 } else { request.tile.pixels() };
    if batch.spp <= info.counts.most(request.spp) && batch.tile == request.tile && batch.mean.len() == pixels
    {
        return Ok(());
    }
    let (pixels, spp, index) = (batch.mean.len(), batch.spp, request.tile.index);
    Err(broken(info, format!("{pixels} pixels of {spp} samples for tile {index}")))
}

fn broken(info: &SourceInfo, what: String) -> FarmError {
    FarmError::Source(SourceError::Contract { name: info.name.clone(), what })
}

/// The next batches of different tiles, as many as one call may have.
fn next_call<'a>(wanted: &mut Vec<Wanted<'a>>) -> Vec<Wanted<'a>> {
    let mut samples = 0;
    let mut call: Vec<Wanted<'a>> = Vec::new();
    for (request, batch) in wanted.iter() {
        samples += request.spp * request.tile.pixels() as u64;
        let again = call.iter().any(|(other, _)| other.tile.index == request.tile.index);
        if !call.is_empty() && (again || samples > CALL) {
            break;
        }
        call.push((*request, batch));
    }
    wanted.drain(..call.len());
    call
}
