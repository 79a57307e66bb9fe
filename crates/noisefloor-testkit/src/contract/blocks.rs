//! Blocks of a tile can be asked for different numbers of samples.

use super::exact::same;
use super::probe::{EDGE, Round, Subject};
use noisefloor::{
    Batch, Counts, ProgressiveSource, Repeats, Tile, TileGrid,
    source::{BlockRequest, BlockSamples},
};

/// Edge of the blocks that are asked for.
const BLOCK: usize = 16;

/// A source that takes requests for blocks gives each block what it was asked for, and the samples that it
/// would have given to the whole tile. `four` are its first rounds of 16 samples.
pub(super) fn check_blocks<S: ProgressiveSource>(subject: &Subject<impl Fn() -> S>, four: &[Round]) {
    let mut source = subject.start().source;
    let Some(none) = answer(&mut source, &[]) else { return };
    assert!(none.is_empty(), "no blocks were asked for, and batches came");
    assert_eq!(subject.info.counts, Counts::Asked, "whoever aims at blocks has to give what is asked for");
    if !subject.promises(Repeats::Samples) {
        return;
    }
    let ask = |source: &mut S, samples: &dyn Fn(usize) -> BlockSamples| {
        let batches = answer(source, &requests(subject, samples));
        vec![batches.expect("blocks can be asked for, or never can")]
    };

    // Asked for as many each, blocks get the samples of their tile
    let even = |first| move |_: usize| BlockSamples { first, spp: 16 };
    let rounds = [ask(&mut source, &even(0)), ask(&mut source, &even(16))].concat();
    assert!(same(&rounds, &four[..2]), "blocks asked for as many samples each got others than their tile");

    // Asked for more or fewer, they get what the tile would have got of as many
    let uneven = |block: usize| BlockSamples { first: 0, spp: [8, 24, 16][block % 3] };
    let mixed = ask(&mut subject.start().source, &uneven).remove(0);
    let whole = [8, 24, 16].map(|spp| subject.rounds(&[spp]).remove(0));
    for (place, batch) in mixed.iter().enumerate() {
        for (pixel, mean) in batch.mean.iter().enumerate() {
            let (x, y) = (pixel % batch.tile.width, pixel / batch.tile.width);
            let block = y / BLOCK * batch.tile.width.div_ceil(BLOCK) + x / BLOCK;
            let expected = whole[block % 3][place].mean[pixel];
            assert!(
                mean.map(f32::to_bits) == expected.map(f32::to_bits),
                "block {block} of tile {place} got other samples than its tile would have got"
            );
        }
    }
}

/// The batches of one call, of which the shape is checked; none if the source does not aim at blocks.
fn answer(source: &mut impl ProgressiveSource, requests: &[BlockRequest]) -> Option<Vec<Batch>> {
    let answer = source.sample_blocks(requests);
    let batches = answer.unwrap_or_else(|e| panic!("sampling blocks failed: {e} ({e:?})"))?;
    assert_eq!(
        batches.len(),
        requests.len(),
        "the number of batches is not the number of requests for blocks"
    );
    for (request, batch) in requests.iter().zip(&batches) {
        assert_eq!(batch.tile, request.tile, "batches are not in the order of the requests for blocks");
        let shape = (batch.spp, batch.mean.len());
        let tile = request.tile.index;
        assert_eq!(
            shape,
            (request.spp, request.tile.pixels()),
            "a batch of blocks of tile {tile} has another shape"
        );
    }
    Some(batches)
}

/// Requests for all tiles, the first samples of block `b` of each as `samples(b)` says.
fn requests<S: ProgressiveSource>(
    subject: &Subject<impl Fn() -> S>,
    samples: &dyn Fn(usize) -> BlockSamples,
) -> Vec<BlockRequest> {
    let grid = TileGrid::new(subject.info.width, subject.info.height, EDGE).expect("the size was checked");
    let request = |tile: Tile| {
        let count = tile.width.div_ceil(BLOCK) * tile.height.div_ceil(BLOCK);
        BlockRequest { tile, spp: 16, edge: BLOCK, blocks: (0..count).map(samples).collect() }
    };
    grid.tiles().map(request).collect()
}
