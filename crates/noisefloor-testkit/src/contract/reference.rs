//! The reference of a renderer that has one.

use super::exact::same;
use super::probe::{EDGE, Subject};
use noisefloor::{
    Oracle, ProgressiveSource, Repeats, Tile, TileGrid, ToneMapping,
    driver::RenderReference,
    evidence::{Rendering, Samples, TilePlanes},
    source::Reference,
};

/// Checks the quick reference of a renderer.
///
/// `make` is given a seed and makes a source of the same scene each time; `render` renders its reference. It has the image's
/// size and is finite, rendering it changes no sample, and it has no noise that the oracle sees. For that, the reference of one
/// seed is compared with that of another: each of its tiles must have converged (bundled model, P ≥ 0.9, tiles of
/// 32×32 pixels). Noise that does not depend on the seed is not found.
///
/// # Panics
/// If a promise is not kept, or there is no reference. The message says which.
pub fn check_reference<S: ProgressiveSource>(make: impl Fn(u64) -> S, render: RenderReference<S>) {
    let [one, other] = [1, 2].map(|seed| sound(&Subject::new(|| make(seed)), render));
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

/// The reference, in itself.
fn sound<S: ProgressiveSource>(subject: &Subject<impl Fn() -> S>, render: RenderReference<S>) -> Reference {
    let (mut probe, info) = (subject.start(), &subject.info);
    let rendered = render(&mut probe.source).unwrap_or_else(|e| panic!("the reference failed: {e} ({e:?})"));
    let reference = rendered.expect("the source has no reference");
    let size = (reference.width, reference.height);
    assert_eq!(size, (info.width, info.height), "the reference does not have the image's size");
    assert_eq!(reference.pixels.len(), info.width * info.height, "wrong number of pixels in the reference");
    assert!(reference.pixels.iter().flatten().all(|c| c.is_finite()), "the reference is not finite");
    if subject.promises(Repeats::Calls) {
        let after = [probe.ask_all(16)];
        assert!(same(&after, &subject.rounds(&[16])), "rendering the reference changed the samples");
    }
    reference
}
