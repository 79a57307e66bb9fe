//! A session that judges beside the rendering.

use crate::border;
use crate::handle;
use crate::session::{NfRequest, NfSession};
use crate::status::{Failure, NfStatus, guard, not_while_denoising};
use noisefloor::background::{Background, News, WhenFull};
use noisefloor::{Request, Rgb, StoppingCriterion};
use std::ffi::c_char;
use std::sync::{Arc, Mutex, PoisonError};

/// nf_background_judge waits until there is room for the pass.
pub const NF_FULL_WAIT: u32 = 0;
/// The pass is added to the one before: the renderer never waits.
pub const NF_FULL_MERGE: u32 = 1;

/// A session on a thread of its own: the renderer hands over a pass and goes on.
pub struct NfBackground {
    background: Background<Box<dyn StoppingCriterion + Send>>,
    session: Arc<NfSession>,
    heard: Mutex<Heard>,
}

#[derive(Default)]
struct Heard {
    judged: u64,
    stopped: usize,
    warnings: Vec<String>,
}

impl handle::Handle for NfBackground {
    const NAME: &str = "background";
}

/// Where a session in the background stands.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NfBackgroundState {
    /// Passes that were judged.
    pub judged: u64,
    /// Passes that were handed over and are not judged yet.
    pub pending: usize,
    /// Samples per pixel that the next pass over the whole picture should have; 0 when all tiles are done.
    pub next_pass: u64,
    /// Samples per pixel that open tiles can still get before they stop at max_spp, beside all that was handed over. A renderer that
    /// has summed up as many waits for the verdict, by nf_background_finish: what it would render meanwhile is beyond the stop. 0
    /// when all tiles are done, or will be with the passes that are pending, as far as is known.
    pub spp_left: u64,
    /// Open tiles, after the last pass that was judged.
    pub open_tiles: usize,
    /// Stops so far. A tile that was open again counts twice.
    pub stops: usize,
    /// Warnings so far, for nf_background_warning.
    pub warnings: usize,
}

impl NfBackground {
    /// Takes notice of what came since the last call.
    fn hear(&self, news: News) -> Heard {
        let mut heard = self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        heard.judged += news.judged as u64;
        heard.stopped += news.stops.len();
        heard.warnings.extend(news.warnings.iter().map(ToString::to_string));
        Heard { warnings: heard.warnings.clone(), ..*heard }
    }
}

fn lent(background: *const NfBackground) -> Result<Arc<NfBackground>, Failure> {
    not_while_denoising()?;
    handle::get(background)
}

/// A copy of an image whose pixels have this many channels.
///
/// # Safety
/// As of [`border::array`].
unsafe fn copied(
    lent: &NfBackground,
    image: *const f32,
    floats: usize,
    channels: usize,
) -> Result<Vec<Rgb>, Failure> {
    border::channels(channels)?;
    let grid = lent.session.grid;
    let wanted = channels * grid.width() * grid.height();
    // SAFETY: promised by the caller.
    let image = unsafe { border::array(image, floats, wanted, "image") }?;
    border::memory(grid, size_of::<Rgb>())?;
    let mut pixels = lent.background.buffer();
    if channels == 3 {
        pixels.copy_from_slice(image.as_chunks().0);
    } else {
        for (pixel, of_image) in pixels.iter_mut().zip(image.chunks_exact(channels)) {
            *pixel = [of_image[0], of_image[1], of_image[2]];
        }
    }
    Ok(pixels)
}

/// Lets a session judge in the background, on a thread of its own. At most `waiting` passes, and at least one, wait
/// behind the one that is being judged; when_full is NF_FULL_WAIT or NF_FULL_MERGE. Until nf_background_end gives the
/// session back, calls on it are NF_STATUS_ARGUMENT, but for nf_session_tile_count, nf_session_tile and
/// nf_session_free. Stops are those of the same session without this, to the bit, and come later.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_background_begin(
    session: *const NfSession,
    waiting: usize,
    when_full: u32,
    background: *mut *mut NfBackground,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        let when_full = match when_full {
            NF_FULL_WAIT => WhenFull::Wait,
            NF_FULL_MERGE => WhenFull::Merge,
            _ => {
                let message = format!("when_full is {when_full}: NF_FULL_WAIT or NF_FULL_MERGE is needed");
                return Err(Failure::new(NfStatus::Argument, message));
            }
        };
        let make = || {
            let lent = session.lend()?;
            let background = Background::new(lent, waiting, when_full)?;
            Ok(NfBackground { background, session, heard: Mutex::default() })
        };
        // SAFETY: promised by the caller.
        unsafe { handle::give(background, make) }
    })
}

/// Adds a batch to the pass: the mean of spp new samples per pixel of the whole picture, with this many channels per
/// pixel, of which the first three are red, green and blue; floats = channels * width * height. It is copied, also from
/// memory that is pinned or mapped for a GPU. Tiles that are done when it is their turn have the samples at the end.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_background_push_image(
    background: *const NfBackground,
    spp: u64,
    image: *const f32,
    floats: usize,
    channels: usize,
) -> NfStatus {
    guard(|| {
        let lent = lent(background)?;
        // SAFETY: promised by the caller.
        let pixels = unsafe { copied(&lent, image, floats, channels) }?;
        Ok(lent.background.push_image(spp, pixels)?)
    })
}

/// As nf_background_push_image, for a renderer that keeps running means: the mean of all total samples per pixel so far.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_background_push_running_image(
    background: *const NfBackground,
    total: u64,
    image: *const f32,
    floats: usize,
    channels: usize,
) -> NfStatus {
    guard(|| {
        let lent = lent(background)?;
        // SAFETY: promised by the caller.
        let pixels = unsafe { copied(&lent, image, floats, channels) }?;
        Ok(lent.background.push_running_image(total, pixels)?)
    })
}

/// Adds a batch of one tile to the pass: as nf_session_push, later.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_background_push(
    background: *const NfBackground,
    tile: usize,
    spp: u64,
    mean: *const f32,
    floats: usize,
) -> NfStatus {
    guard(|| {
        let lent = lent(background)?;
        let wanted = 3 * lent.session.tile(tile)?.pixels();
        // SAFETY: promised by the caller.
        let mean = unsafe { border::array(mean, floats, wanted, "mean") }?;
        Ok(lent.background.push(tile, spp, mean.as_chunks().0.to_vec())?)
    })
}

/// Hands over the pass: all batches since the last call. They are pushed and judged in the background. What fails
/// there, such as NF_STATUS_FAULT, is the status of this or a later call.
#[unsafe(no_mangle)]
pub extern "C" fn nf_background_judge(background: *const NfBackground) -> NfStatus {
    guard(|| Ok(lent(background)?.background.judge()?))
}

/// Where the session stands, without waiting. Its status is what failed in the background, if anything has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_background_state(
    background: *const NfBackground,
    state: *mut NfBackgroundState,
) -> NfStatus {
    guard(|| {
        let lent = lent(background)?;
        border::check(state, "state")?;
        let Heard { judged, stopped, warnings } = lent.hear(lent.background.news()?);
        let found = NfBackgroundState {
            judged,
            pending: lent.background.pending(),
            next_pass: lent.background.next_pass().unwrap_or(0),
            spp_left: lent.background.spp_left(),
            open_tiles: lent.background.requests().len(),
            stops: stopped,
            warnings: warnings.len(),
        };
        // SAFETY: promised by the caller.
        unsafe { border::write(state, found, "state") }
    })
}

/// What the open tiles wanted after the last pass that was judged, as nf_session_requests. What was handed over since
/// is not in it, so number samples yourself instead of by `first` and `point`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_background_requests(
    background: *const NfBackground,
    requests: *mut NfRequest,
    capacity: usize,
    count: *mut usize,
) -> NfStatus {
    guard(|| {
        let lent = lent(background)?;
        let tiles = lent.session.grid.len();
        // SAFETY: promised by the caller.
        let room = unsafe { border::room(requests, capacity, tiles, "requests") }?;
        let wanted: Vec<Request> = lent.background.requests();
        // SAFETY: promised by the caller.
        unsafe { border::write(count, wanted.len(), "count") }?;
        room.iter_mut().zip(wanted).for_each(|(place, request)| *place = request.into());
        Ok(())
    })
}

/// One of the warnings that nf_background_state has counted, by its number from 0 on: as nf_session_warning.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_background_warning(
    background: *const NfBackground,
    index: usize,
    text: *mut c_char,
    bytes: usize,
) -> NfStatus {
    guard(|| {
        let lent = lent(background)?;
        let heard = lent.heard.lock().unwrap_or_else(PoisonError::into_inner);
        let missing = || {
            let message = format!("warning {index} does not exist: there are {}", heard.warnings.len());
            Failure::new(NfStatus::Argument, message)
        };
        let warning = heard.warnings.get(index).ok_or_else(missing)?;
        // SAFETY: promised by the caller.
        unsafe { border::write_text(text, bytes, warning, "text") }
    })
}

/// Waits until no pass waits. Its status is what failed in the background, if anything has.
#[unsafe(no_mangle)]
pub extern "C" fn nf_background_finish(background: *const NfBackground) -> NfStatus {
    guard(|| {
        let lent = lent(background)?;
        lent.hear(lent.background.finish()?);
        Ok(())
    })
}

/// Waits until no pass waits, gives the session back to its handle, with samples that came after their tile had
/// stopped, and frees the background. What failed in a push or a verdict is no error of this call: ask
/// nf_background_finish before. NULL is ignored, a second time is NF_STATUS_HANDLE.
#[unsafe(no_mangle)]
pub extern "C" fn nf_background_end(background: *mut NfBackground) -> NfStatus {
    guard(|| {
        if background.is_null() {
            return Ok(());
        }
        let lent = lent(background)?;
        handle::free(background)?;
        lent.session.take_back(lent.background.take_session()?)
    })
}
