//! What comes of a session: where its tiles stand, its picture, and the map of visible noise.

use crate::border;
use crate::handle;
use crate::session::NfSession;
use crate::status::{Failure, NfStatus, guard};
use noisefloor::{StopReason, criterion::OpenFor, session::Interruption, source::PixelNoise};
use std::ffi::c_char;

/// The tile is open: it gets more samples.
pub const NF_REASON_OPEN: u32 = 0;
/// Nobody would see noise in it.
pub const NF_REASON_CONVERGED: u32 = 1;
/// It has as many samples as are allowed.
pub const NF_REASON_MAX_SPP: u32 = 2;
/// Closed by the caller: there is no more time.
pub const NF_REASON_TIME_LIMIT: u32 = 3;
/// Closed by the caller: somebody cancelled.
pub const NF_REASON_CANCELLED: u32 = 4;
/// Closed by the caller: the renderer failed.
pub const NF_REASON_FAILED: u32 = 5;

/// Nothing keeps the tile open.
pub const NF_OPEN_FOR_NOTHING: u32 = 0;
/// What is wrong with the tile, mostly its noise, would be seen.
pub const NF_OPEN_FOR_NOISE: u32 = 1;
/// The exposure of the picture is not known well enough.
pub const NF_OPEN_FOR_EXPOSURE: u32 = 2;
/// Of light that few samples have met elsewhere, as much as the tile is likely to lack would be seen.
pub const NF_OPEN_FOR_UNMET_LIGHT: u32 = 3;
/// So few samples that neither noise in few pixels is known yet, nor what light none of them has met.
pub const NF_OPEN_FOR_FEW_SAMPLES: u32 = 4;
/// Doubts about the samples themselves: see the warnings.
pub const NF_OPEN_FOR_DOUBT: u32 = 5;

/// Where a tile stands.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NfTileState {
    /// Samples per pixel; if the tile is done, when it stopped.
    pub spp: u64,
    /// Samples per pixel at which the oracle expects the tile to be free of visible noise; 0 if it cannot
    /// tell.
    pub expected_spp: u64,
    /// Probability that an observer sees no difference from the converged picture, by the last verdict; NaN
    /// before the first.
    pub probability: f32,
    /// NF_REASON_OPEN, or why the tile is done.
    pub reason: u32,
    /// What keeps the tile from being done, or has kept it until a limit: NF_OPEN_FOR_NOTHING, or another of these.
    pub open_for: u32,
    /// Whether the tile's texture is unlike all that the model was trained on: treat the verdict with care.
    pub unfamiliar: bool,
}

fn open_for_code(open_for: Option<OpenFor>) -> u32 {
    match open_for {
        None => NF_OPEN_FOR_NOTHING,
        Some(OpenFor::Exposure) => NF_OPEN_FOR_EXPOSURE,
        Some(OpenFor::UnmetLight) => NF_OPEN_FOR_UNMET_LIGHT,
        Some(OpenFor::FewSamples) => NF_OPEN_FOR_FEW_SAMPLES,
        Some(OpenFor::Doubt) => NF_OPEN_FOR_DOUBT,
        Some(_) => NF_OPEN_FOR_NOISE,
    }
}

fn reason_code(reason: StopReason) -> u32 {
    match reason {
        // An oracle counts no samples and no source is exhausted here; whatever is added is a stop.
        StopReason::MaxSpp => NF_REASON_MAX_SPP,
        StopReason::TimeLimit => NF_REASON_TIME_LIMIT,
        StopReason::Cancelled => NF_REASON_CANCELLED,
        StopReason::Failed => NF_REASON_FAILED,
        _ => NF_REASON_CONVERGED,
    }
}

/// Where all tiles stand, in their order, into an array for at least as many states as there are tiles (capacity says
/// how many).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_states(
    session: *const NfSession,
    states: *mut NfTileState,
    capacity: usize,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        // SAFETY: promised by the caller.
        let room = unsafe { border::room(states, capacity, session.grid.len(), "states") }?;
        let locked = session.lock()?;
        for (tile, state) in room.iter_mut().enumerate() {
            let verdict = locked.verdict(tile);
            *state = NfTileState {
                spp: locked.film().spp(tile),
                expected_spp: verdict.and_then(|v| v.expected_spp).unwrap_or(0),
                probability: verdict.and_then(|v| v.probability).unwrap_or(f32::NAN),
                reason: NF_REASON_OPEN,
                open_for: open_for_code(locked.open_for(tile)),
                unfamiliar: verdict.is_some_and(|v| v.unfamiliar),
            };
        }
        for stop in locked.stops() {
            let state = &mut room[stop.tile.index];
            (state.spp, state.reason) = (stop.spp, reason_code(stop.reason));
        }
        Ok(())
    })
}

/// The number of open tiles; 0 when all are done.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_open_tiles(session: *const NfSession, open: *mut usize) -> NfStatus {
    guard(|| {
        let found = handle::get(session)?.lock()?.open_tiles();
        // SAFETY: promised by the caller.
        unsafe { border::write(open, found, "open") }
    })
}

/// Ends every open tile for NF_REASON_TIME_LIMIT, NF_REASON_CANCELLED or NF_REASON_FAILED.
#[unsafe(no_mangle)]
pub extern "C" fn nf_session_close_all(session: *const NfSession, reason: u32) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        let reason = match reason {
            NF_REASON_TIME_LIMIT => Interruption::TimeLimit,
            NF_REASON_CANCELLED => Interruption::Cancelled,
            NF_REASON_FAILED => Interruption::Failed,
            other => {
                let message = format!("{other} is no reason for a caller to end tiles");
                return Err(Failure::new(NfStatus::Argument, message));
            }
        };
        session.lock()?.close_all(reason);
        Ok(())
    })
}

/// Samples still to be taken, over all pixels, as the oracle expects; NF_STATUS_UNAVAILABLE while an open
/// tile has no expectation.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_expected_samples(
    session: *const NfSession,
    samples: *mut u64,
) -> NfStatus {
    guard(|| {
        let expected = handle::get(session)?.lock()?.expected_samples_to_go();
        let unknown = "there is a tile of which the oracle cannot yet say how many samples it needs";
        let expected = expected.ok_or_else(|| Failure::new(NfStatus::Unavailable, unknown))?;
        // SAFETY: promised by the caller.
        unsafe { border::write(samples, expected, "samples") }
    })
}

/// What samples were like that were pushed.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NfSampleCounts {
    /// Samples, over all pixels, that were left out because their batch was not finite.
    pub rejected: u64,
    /// Samples, over all pixels, whose batch had negative luminance; since a resume.
    pub negative: u64,
    /// Warnings: what is likely to be wrong with the samples, as of the last nf_session_judge. See
    /// nf_session_warning.
    pub warnings: usize,
}

/// Counts samples that are not as they should be.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_sample_counts(
    session: *const NfSession,
    counts: *mut NfSampleCounts,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        let session = session.lock()?;
        let (rejected, negative) = (session.film().rejected(), session.negative_samples());
        let found = NfSampleCounts { rejected, negative, warnings: session.warnings().len() };
        // SAFETY: promised by the caller.
        unsafe { border::write(counts, found, "counts") }
    })
}

/// The text of a warning, 0 to NfSampleCounts.warnings - 1, in English, for people: cut to bytes - 1 bytes and
/// ended by a zero. 400 bytes hold any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_warning(
    session: *const NfSession,
    index: usize,
    text: *mut c_char,
    bytes: usize,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        let session = session.lock()?;
        let unknown = || Failure::new(NfStatus::Argument, format!("there is no warning {index}"));
        let warning = session.warnings().get(index).ok_or_else(unknown)?.to_string();
        // SAFETY: promised by the caller.
        unsafe { border::write_text(text, bytes, &warning, "text") }
    })
}

/// Says whether neighbouring pixels have noise in common, by a pixel filter, a denoiser or a Markov chain: no
/// warning says so then.
#[unsafe(no_mangle)]
pub extern "C" fn nf_session_share_pixels(session: *const NfSession, shared: bool) -> NfStatus {
    guard(|| {
        let pixels = if shared { PixelNoise::Shared } else { PixelNoise::Independent };
        handle::get(session)?.lock()?.set_pixels(pixels);
        Ok(())
    })
}

/// Says that what is pushed is linear radiance, so that no warning asks: where all batches have
/// one size, nothing tells that from values that were encoded for a screen.
#[unsafe(no_mangle)]
pub extern "C" fn nf_session_set_linear(session: *const NfSession) -> NfStatus {
    guard(|| {
        handle::get(session)?.lock()?.set_linear();
        Ok(())
    })
}

/// The picture: the mean of all samples, floats = 3 * width * height of the image. Pixels without samples are
/// black.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_image(
    session: *const NfSession,
    image: *mut f32,
    floats: usize,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        let wanted = 3 * session.grid.width() * session.grid.height();
        // SAFETY: promised by the caller.
        let room = unsafe { border::array_mut(image, floats, wanted, "image") }?;
        // Without a copy of the whole picture
        let (locked, pixels) = (session.lock()?, room.as_chunks_mut().0);
        for tile in session.grid.tiles() {
            for pixel in tile.rows(session.grid.width()).flatten() {
                pixels[pixel] = locked.film().pixel(tile.index, pixel);
            }
        }
        Ok(())
    })
}

/// How visible the noise is at each pixel, 1 where it is just seen: floats = width * height of the image, NaN
/// where there is no evidence. Costs as much as a verdict on every tile. NF_STATUS_UNAVAILABLE before
/// the first verdict, or if the model makes no map.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_visible_noise(
    session: *const NfSession,
    map: *mut f32,
    floats: usize,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        let wanted = session.grid.width() * session.grid.height();
        // SAFETY: promised by the caller.
        let room = unsafe { border::array_mut(map, floats, wanted, "map") }?;
        border::memory(session.grid, 4 * size_of::<f32>())?;
        let none = "no map: there is no verdict yet, or the model makes none";
        let found = session.lock()?.visible_noise();
        room.copy_from_slice(&found.ok_or_else(|| Failure::new(NfStatus::Unavailable, none))?);
        Ok(())
    })
}
