//! Work in tasks of about equal length.

use noisefloor::Request;
use serde::{Deserialize, Serialize};

/// Samples, over all pixels, below which a task would spend its time on starting.
const LEAST: u64 = 1 << 18;
/// Batches of a task may have this many pixels together: it keeps them in memory, 12 bytes each.
const MOST_PIXELS: u64 = 1 << 25;

/// What one process of a round samples, into one shard.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Task {
    /// Index of the frame.
    pub frame: usize,
    /// Tile, first sample and samples of each batch, in the order of the samples of each tile.
    pub batches: Vec<(usize, u64, u64)>,
}

/// Splits batches of (frame, batch) into tasks of about equal length, at most about `tasks`, by frames, tiles
/// and ranges of samples. The batches of a frame, and the samples of a tile, must come one after the other.
///
/// Few batches make fewer tasks; many make more where a task would hold too many in memory.
pub fn split(batches: Vec<(usize, Request)>, tasks: usize) -> Vec<Task> {
    let cost = |batch: &Request| batch.spp * batch.tile.pixels() as u64;
    let total: u64 = batches.iter().map(|(_, batch)| cost(batch)).sum();
    let share = total.div_ceil(tasks.max(1) as u64).max(LEAST);
    let mut split: Vec<Task> = Vec::new();
    let (mut samples, mut place, mut pixels) = (0, 0, 0);
    for (frame, batch) in batches {
        // Each batch goes where its middle is
        let here = (samples + cost(&batch) / 2) / share;
        samples += cost(&batch);
        pixels += batch.tile.pixels() as u64;
        if here != place || pixels > MOST_PIXELS || split.last().is_none_or(|task| task.frame != frame) {
            split.push(Task { frame, batches: Vec::new() });
            (place, pixels) = (here, batch.tile.pixels() as u64);
        }
        if let Some(task) = split.last_mut() {
            task.batches.push((batch.tile.index, batch.first, batch.spp));
        }
    }
    split
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor::TileGrid;

    #[test]
    fn every_batch_is_in_one_task_and_tasks_are_even() {
        let grid = TileGrid::new(1024, 512, 128).unwrap();
        let batch = |tile, first| Request { tile: grid.tile(tile), first, spp: 50 };
        let all: Vec<(usize, Request)> =
            (0..2).flat_map(|f| (0..32).flat_map(move |t| [(f, batch(t, 0)), (f, batch(t, 50))])).collect();
        for tasks in [1, 2, 3, 7, 20, 64, 1000] {
            let split = split(all.clone(), tasks);
            let flat: Vec<_> =
                split.iter().flat_map(|t| t.batches.iter().map(|&(i, f, s)| (t.frame, i, f, s))).collect();
            let wanted: Vec<_> = all.iter().map(|(f, b)| (*f, b.tile.index, b.first, b.spp)).collect();
            assert_eq!(flat, wanted);
            // A frame more than asked for, where a task would span two; and no task has less than half of 2¹⁸
            // samples
            assert!(split.len() <= tasks.min(128) + 1, "{} for {tasks}", split.len());
            let (least, most) =
                (split.iter().map(|t| t.batches.len()).min(), split.iter().map(|t| t.batches.len()).max());
            assert!(most <= Some(128 / tasks.clamp(1, 64) + 1), "{tasks}: {least:?} to {most:?}");
        }
    }
}
