//! Promises that a source keeps to the bit, or but for rounding.

use super::probe::{Probe, Round};
use super::rounding::ROUNDING;
use noisefloor::{Batch, ProgressiveSource};

/// Whether every batch has as many samples.
pub(super) fn all_have(round: &Round, spp: u64) -> bool {
    round.iter().all(|batch| batch.spp == spp)
}

/// Whether rounds are equal to the bit, NaN and −0 included.
pub(super) fn same(a: &[Round], b: &[Round]) -> bool {
    let bits = |batch: &Batch| -> Vec<u32> { batch.mean.iter().flatten().map(|c| c.to_bits()).collect() };
    let equal = |(a, b): (&Batch, &Batch)| a.tile == b.tile && a.spp == b.spp && bits(a) == bits(b);
    a.len() == b.len() && a.iter().flatten().zip(b.iter().flatten()).all(equal)
}

/// 8 and then 24 samples have the mean that 32 samples have, but for rounding.
pub(super) fn check_cut(whole: &Round, parts: &[Round]) {
    for (tile, all) in whole.iter().enumerate() {
        for (pixel, all) in all.mean.iter().enumerate() {
            for (c, &all) in all.iter().enumerate() {
                let [a, b] = [0, 1].map(|part: usize| f64::from(parts[part][tile].mean[pixel][c]));
                let (both, all) = ((8.0 * a + 24.0 * b) / 32.0, f64::from(all));
                let size = a.abs().max(b.abs()).max(f64::from(f32::MIN_POSITIVE));
                let close = (both - all).abs() <= ROUNDING * size || !(both.is_finite() && all.is_finite());
                assert!(
                    close,
                    "samples depend on how requests are cut: tile {tile}, \
                     pixel {pixel} is {both} in two batches and {all} in one"
                );
            }
        }
    }
}

/// Tiles can be asked for alone. To the bit, they then get the samples that they get in company, at whatever
/// depth the others are.
pub(super) fn check_aiming<S: ProgressiveSource>(mut probe: Probe<S>, rounds: &[Round], to_the_bit: bool) {
    assert!(probe.ask(&[], 16).is_empty());
    let last = probe.tiles.len() - 1;
    let alone = probe.ask(&[last], 16);
    let together = probe.ask_all(16);
    if !to_the_bit {
        return;
    }
    let company = vec![rounds[0][last].clone()];
    assert!(same(&[alone], &[company]), "a tile asked for alone got other samples than in company");
    for (tile, batch) in together.into_iter().enumerate() {
        let depth = usize::from(tile == last);
        let right = same(&[vec![batch]], &[vec![rounds[depth][tile].clone()]]);
        assert!(right, "tile {tile} got other samples because its neighbours are at another depth");
    }
}
