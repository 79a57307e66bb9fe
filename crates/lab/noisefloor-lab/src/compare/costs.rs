//! What sampling costs, tile by tile.

use noisefloor::{Batch, ProgressiveSource, Request, SourceError, Tile};
use std::time::Instant;

/// What sampling costs, tile by tile.
pub(super) struct Costs {
    calls: usize,
    /// For each tile, seconds of the call that sampled only this tile.
    alone: Vec<f64>,
    /// Seconds and pixel samples of the calls for all tiles together, the first one left out.
    seconds: f64,
    samples: f64,
    /// Of the first call, in case there is no other.
    first: (f64, f64),
}

impl Costs {
    pub(super) fn new(tiles: usize) -> Self {
        Self { calls: 0, alone: vec![1.0; tiles], seconds: 0.0, samples: 0.0, first: (0.0, 1.0) }
    }

    pub(super) fn sample(
        &mut self,
        source: &mut dyn ProgressiveSource,
        requests: &[Request],
    ) -> Result<Vec<Batch>, SourceError> {
        self.calls += 1;
        if self.calls == 2 && source.info().aims {
            let mut batches = Vec::with_capacity(requests.len());
            for (request, seconds) in requests.iter().zip(&mut self.alone) {
                let began = Instant::now();
                batches.extend(source.sample(std::slice::from_ref(request))?);
                *seconds = began.elapsed().as_secs_f64().max(1e-9);
            }
            return Ok(batches);
        }
        let began = Instant::now();
        let batches = source.sample(requests)?;
        let seconds = began.elapsed().as_secs_f64();
        let samples: f64 = batches.iter().map(|b| b.spp as f64 * b.tile.pixels() as f64).sum();
        if self.calls == 1 {
            self.first = (seconds, samples.max(1.0));
        } else {
            self.seconds += seconds;
            self.samples += samples;
        }
        Ok(batches)
    }

    /// Seconds that one sample of each pixel of a tile costs, such that all together cost what they did.
    pub(super) fn tile_seconds(&self, tiles: &[Tile]) -> Vec<f64> {
        let (seconds, samples) = if self.samples > 0.0 { (self.seconds, self.samples) } else { self.first };
        let pixels: f64 = tiles.iter().map(|t| t.pixels() as f64).sum();
        let all: f64 = self.alone.iter().sum();
        self.alone.iter().map(|alone| seconds / samples * pixels * alone / all).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_of_tiles_add_up_to_what_all_cost() {
        let grid = noisefloor::TileGrid::new(64, 32, 32).unwrap();
        let costs =
            Costs { calls: 9, alone: vec![0.3, 0.1], seconds: 5.0, samples: 1000.0, first: (9.0, 10.0) };
        let tiles: Vec<Tile> = grid.tiles().collect();
        let each = costs.tile_seconds(&tiles);
        // 5 ms a pixel sample, 2048 pixels: 10.24 s a sample everywhere, three quarters of it in the first
        // tile.
        assert!((each[0] - 7.68).abs() < 1e-9 && (each[1] - 2.56).abs() < 1e-9, "{each:?}");
        let started = Costs { samples: 0.0, ..costs };
        assert!((started.tile_seconds(&tiles).iter().sum::<f64>() - 0.9 * 2048.0).abs() < 1e-9);
    }
}
