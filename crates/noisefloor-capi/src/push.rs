//! Samples of the renderer.

use crate::border;
use crate::handle;
use crate::session::NfSession;
use crate::status::{NfStatus, guard};
use noisefloor::Rgb;

/// Adds the mean of spp new samples per pixel of a tile: rows of the tile from the top, floats = 3 * width *
/// height of the tile. Tiles that are done accept samples, too: they improve, and stay done.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_push(
    session: *const NfSession,
    tile: usize,
    spp: u64,
    mean: *const f32,
    floats: usize,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        let wanted = 3 * session.tile(tile)?.pixels();
        // SAFETY: promised by the caller.
        let mean = unsafe { border::array(mean, floats, wanted, "mean") }?;
        Ok(session.lock()?.push(tile, spp, mean.as_chunks().0)?)
    })
}

/// As nf_session_push, for a renderer that keeps running means: the mean of all total samples per pixel of
/// the tile so far. The new samples are what it has more than the session.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_push_running(
    session: *const NfSession,
    tile: usize,
    total: u64,
    mean: *const f32,
    floats: usize,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        let wanted = 3 * session.tile(tile)?.pixels();
        // SAFETY: promised by the caller.
        let mean = unsafe { border::array(mean, floats, wanted, "mean") }?;
        Ok(session.lock()?.push_running(tile, total, mean.as_chunks().0)?)
    })
}

/// As nf_session_push, from a picture of the whole image with this many channels per pixel, of which the
/// first three are red, green and blue: floats = channels * width * height of the image. Only the tile is
/// read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_push_image(
    session: *const NfSession,
    tile: usize,
    spp: u64,
    image: *const f32,
    floats: usize,
    channels: usize,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        border::channels(channels)?;
        let (tile, width) = (session.tile(tile)?, session.grid.width());
        let wanted = channels * width * session.grid.height();
        // SAFETY: promised by the caller.
        let image = unsafe { border::array(image, floats, wanted, "image") }?;
        let colour = |pixel: usize| -> Rgb { std::array::from_fn(|c| image[channels * pixel + c]) };
        let mean: Vec<Rgb> = tile.rows(width).flatten().map(colour).collect();
        Ok(session.lock()?.push(tile.index, spp, &mean)?)
    })
}
