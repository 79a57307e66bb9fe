//! Work in tasks of about equal length.

use crate::batch::PlannedBatch;
use noisefloor::TileGrid;
use serde::{Deserialize, Serialize};

/// Samples, over all pixels, below which a task would spend its time on starting.
const LEAST: u64 = 1 << 18;
/// Batches of a task may have this many pixels together: it keeps them in memory, 12 bytes each.
const MOST_PIXELS: u64 = 1 << 25;

/// What one process of a round samples, into one shard.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Task {
    pub frame: usize,
    /// Its batches, in the order of the samples of each tile.
    pub batches: Vec<PlannedBatch>,
}

/// Splits what each frame needs into tasks of about equal length, at most about `tasks`, by frames, tiles
/// and ranges of samples. The samples of a tile must come one after the other.
///
/// Few batches make fewer tasks; many make more where a task would hold too many in memory.
///
/// # Panics
/// If a frame has no such tile.
pub fn split(frames: Vec<(TileGrid, Vec<PlannedBatch>)>, tasks: usize) -> Vec<Task> {
    let cost = |grid: &TileGrid, batch: &PlannedBatch| batch.spp * grid.tile(batch.tile).pixels() as u64;
    let of_frame = |(grid, batches): &(TileGrid, Vec<PlannedBatch>)| -> u64 {
        batches.iter().map(|batch| cost(grid, batch)).sum()
    };
    let total: u64 = frames.iter().map(of_frame).sum();
    let share = total.div_ceil(tasks.max(1) as u64).max(LEAST);
    let mut split: Vec<Task> = Vec::new();
    let (mut samples, mut place, mut pixels) = (0, 0, 0);
    for (frame, (grid, batches)) in frames.into_iter().enumerate() {
        for batch in batches {
            // Each batch goes where its middle is
            let (cost, area) = (cost(&grid, &batch), grid.tile(batch.tile).pixels() as u64);
            let here = (samples + cost / 2) / share;
            samples += cost;
            pixels += area;
            if here != place || pixels > MOST_PIXELS || split.last().is_none_or(|task| task.frame != frame) {
                split.push(Task { frame, batches: Vec::new() });
                (place, pixels) = (here, area);
            }
            if let Some(task) = split.last_mut() {
                task.batches.push(batch);
            }
        }
    }
    split
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_batch_is_in_one_task_and_tasks_are_even() {
        let grid = TileGrid::new(1024, 512, 128).unwrap();
        let of_frame: Vec<PlannedBatch> =
            (0..32).flat_map(|t| [PlannedBatch::new(t, 0, 50), PlannedBatch::new(t, 50, 50)]).collect();
        let all = vec![(grid, of_frame.clone()), (grid, of_frame)];
        for tasks in [1, 2, 3, 7, 20, 64, 1000] {
            let split = split(all.clone(), tasks);
            let flat: Vec<_> = split.iter().flat_map(|t| t.batches.iter().map(|b| (t.frame, b))).collect();
            let wanted = all.iter().enumerate().flat_map(|(f, (_, bs))| bs.iter().map(move |b| (f, b)));
            assert_eq!(flat, wanted.collect::<Vec<_>>());
            // A frame more than asked for, where a task would span two; and no task has less than half of
            // 2¹⁸ samples
            assert!(split.len() <= tasks.min(128) + 1, "{} for {tasks}", split.len());
            let (least, most) =
                (split.iter().map(|t| t.batches.len()).min(), split.iter().map(|t| t.batches.len()).max());
            assert!(most <= Some(128 / tasks.clamp(1, 64) + 1), "{tasks}: {least:?} to {most:?}");
        }
    }
}
