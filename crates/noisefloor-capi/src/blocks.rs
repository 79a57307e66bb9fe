//! Samples block by block: what each block of a tile is to get, and the batches that come of it.

use crate::border;
use crate::handle;
use crate::session::NfSession;
use crate::status::{Failure, NfStatus, guard};
use noisefloor::{
    Oracle, Request, Session, Tile,
    source::{BlockRequest, BlockSamples},
};

/// How a tile is cut into blocks, which are counted in rows from the top left of the tile.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NfBlocks {
    /// Edge of a block in pixels; blocks of the last column and the last row may be smaller.
    pub edge: usize,
    /// Blocks in a row.
    pub columns: usize,
    /// Rows of blocks. The pixel (x, y) of the tile lies in block y / edge * columns + x / edge.
    pub rows: usize,
}

/// What one block is to get.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NfBlockSamples {
    /// Samples per pixel that the block already has: the number of its first new one.
    pub first: u64,
    /// New samples per pixel, at least 1.
    pub spp: u64,
}

/// What a session asks of the blocks of a tile.
fn asked(session: &Session<Oracle>, tile: Tile, spp: u64) -> Result<BlockRequest, Failure> {
    if spp == 0 {
        let nothing = format!("no samples for tile {}: spp is 0", tile.index);
        return Err(Failure::new(NfStatus::Batch, nothing));
    }
    let request = Request { tile, first: session.film().spp(tile.index), spp };
    let none = "tiles of this session have no blocks: NfParams.blocks is 0";
    session.block_request(&request).ok_or_else(|| Failure::new(NfStatus::Unavailable, none))
}

/// Spreads spp new samples per pixel of a tile over its blocks, for renderers that can give each block its own
/// number of samples. tile and spp are those of an NfRequest; as there, fewer or more samples are fine.
///
/// layout becomes how the tile is cut, and blocks what each block is to get, row by row: spp on average over
/// the pixels of the tile, except for rounding. capacity says how many elements blocks has: columns * rows or
/// more. (tile / blocks)^2, of NfParams, are enough for every tile.
///
/// Push the answer with nf_session_push_blocks. A renderer that cannot aim at blocks answers the request with
/// nf_session_push. NF_STATUS_UNAVAILABLE if NfParams.blocks is 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_block_request(
    session: *const NfSession,
    tile: usize,
    spp: u64,
    layout: *mut NfBlocks,
    blocks: *mut NfBlockSamples,
    capacity: usize,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        let area = session.tile(tile)?;
        let asked = asked(&*session.lock()?, area, spp)?;
        // SAFETY: promised by the caller.
        let room = unsafe { border::room(blocks, capacity, asked.blocks.len(), "blocks") }?;
        let (columns, rows) = (area.width.div_ceil(asked.edge), area.height.div_ceil(asked.edge));
        // SAFETY: promised by the caller.
        unsafe { border::write(layout, NfBlocks { edge: asked.edge, columns, rows }, "layout") }?;
        for (place, &BlockSamples { first, spp }) in room.iter_mut().zip(&asked.blocks) {
            *place = NfBlockSamples { first, spp };
        }
        Ok(())
    })
}

/// Adds the samples that nf_session_block_request asked for with the same tile and spp: for each pixel of the
/// tile the mean of the new samples of its block, laid out as for nf_session_push. blocks is what was asked
/// for, unchanged, and count its number of elements: columns * rows. first is not read.
///
/// Every pixel of the batch counts as spp samples, however many its block got. Do not weight the means
/// yourself: this is what keeps the picture free of bias.
///
/// NF_STATUS_BATCH if these are not the numbers of samples that the session asks of these blocks. Judging a
/// tile changes them, so push what was asked for before that.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_push_blocks(
    session: *const NfSession,
    tile: usize,
    spp: u64,
    blocks: *const NfBlockSamples,
    count: usize,
    mean: *const f32,
    floats: usize,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        let area = session.tile(tile)?;
        // SAFETY: promised by the caller.
        let mean = unsafe { border::array(mean, floats, 3 * area.pixels(), "mean") }?;
        let mut locked = session.lock()?;
        let asked = asked(&locked, area, spp)?;
        // SAFETY: promised by the caller.
        let blocks = unsafe { border::array(blocks, count, asked.blocks.len(), "blocks") }?;
        if let Some(at) = blocks.iter().zip(&asked.blocks).position(|(got, wanted)| got.spp != wanted.spp) {
            let (got, wanted) = (blocks[at].spp, asked.blocks[at].spp);
            let message = format!(
                "block {at} of tile {tile} has {got} new samples per pixel, and the session asks for \
                 {wanted}: push what nf_session_block_request says, before the tile is judged"
            );
            return Err(Failure::new(NfStatus::Batch, message));
        }
        Ok(locked.push_blocks(&asked, mean.as_chunks().0)?)
    })
}
