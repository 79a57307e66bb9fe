//! The reference of a source.

use super::probe::EDGE;
use noisefloor::{
    Oracle, ProgressiveSource, SourceInfo, Tile, TileGrid, ToneMapping,
    evidence::{Rendering, Samples, TilePlanes},
    source::Reference,
};

/// Checks that the oracle sees no noise in the reference of a source.
///
/// `make` is given a seed and makes a source of the same scene each time. The reference of one seed is
/// compared with that of another: each of its tiles must have converged (bundled model, P ≥ 0.9, tiles of
/// 32×32 pixels). Noise that does not depend on the seed is not found.
///
/// # Panics
/// If a tile has not converged, there is no reference, or [`check_source`](crate::check_source) rejects it.
pub fn check_reference_is_free_of_noise<S: ProgressiveSource>(make: impl Fn(u64) -> S) {
    let [one, other] = [1, 2].map(|seed| {
        let mut source = make(seed);
        let info = source.info();
        check_reference(&mut source, &info).expect("the source has no reference")
    });
    let (size, oracle) = ((one.width, one.height), Oracle::bundled());
    let display = ToneMapping::default().settle(&one.pixels);
    // Each counts as one sample of a pixel
    let pair = [&one, &other].map(|r| Rendering { pixels: &r.pixels, spp: 1.0, rounding: 0.0 }).into();
    let tiles: Vec<Tile> = TileGrid::new(size.0, size.1, EDGE).expect("an image in range").tiles().collect();
    let describe = |&tile: &Tile| {
        let planes = TilePlanes::from_pair(size, tile, &display, pair, Samples::Independent);
        oracle.describe(&planes.expect("samples"), 1.0).expect("any tile")
    };
    let described: Vec<_> = tiles.iter().map(describe).collect();
    for (tile, verdict) in tiles.iter().zip(oracle.judge_described(&described)) {
        let (index, p) = (tile.index, verdict.probability);
        assert!(verdict.converged, "tile {index} of the reference has noise that the oracle sees: P = {p:?}");
    }
}

/// The reference, if there is one: as large as the image, and finite.
pub(super) fn check_reference(source: &mut impl ProgressiveSource, info: &SourceInfo) -> Option<Reference> {
    let reference = source.reference().unwrap_or_else(|e| panic!("the reference failed: {e} ({e:?})"))?;
    let size = (reference.width, reference.height);
    assert_eq!(size, (info.width, info.height), "the reference does not have the image's size");
    assert_eq!(reference.pixels.len(), info.width * info.height, "wrong number of pixels in the reference");
    assert!(reference.pixels.iter().flatten().all(|c| c.is_finite()), "the reference is not finite");
    Some(reference)
}
