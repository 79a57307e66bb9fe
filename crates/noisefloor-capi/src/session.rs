//! Sessions: pushed samples in, stops out.

use crate::border;
use crate::denoise::{DenoisedBy, NfDenoise, guides, passes_of};
use crate::handle;
use crate::oracle::NfOracle;
use crate::params::NfParams;
use crate::status::{Failure, NfStatus, guard, not_while_denoising};
use noisefloor::{
    Checkpoint, Oracle, Params, Request, Rgb, Schedule, Session, StoppingCriterion, Tile, TileGrid, Verdict,
};
use std::ffi::c_void;
use std::mem::MaybeUninit;
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Mutex, MutexGuard};

/// Film, oracle and limits of one picture.
pub struct NfSession {
    judged: Mutex<Judged>,
    judging: Judging,
    pub(crate) grid: TileGrid,
}

/// What a session judges by: a session that is resumed gets a new criterion.
pub(crate) enum Judging {
    Noise(Box<Oracle>),
    Denoised(DenoisedBy),
}

/// A session that is here or elsewhere.
pub(crate) struct Judged {
    /// Elsewhere while it judges in the background.
    session: Option<Session<Box<dyn StoppingCriterion + Send>>>,
}

impl Deref for Judged {
    type Target = Session<Box<dyn StoppingCriterion + Send>>;

    fn deref(&self) -> &Self::Target {
        self.session.as_ref().expect("a session that is elsewhere is not locked")
    }
}

impl DerefMut for Judged {
    fn deref_mut(&mut self) -> &mut Self::Target {
        self.session.as_mut().expect("a session that is elsewhere is not locked")
    }
}

impl Judging {
    fn fresh(&self, (width, height): (usize, usize), params: Params) -> Result<Judged, Failure> {
        let criterion: Box<dyn StoppingCriterion + Send> = match self {
            Self::Noise(oracle) => oracle.clone(),
            Self::Denoised(denoised) => Box::new(denoised.quality()),
        };
        Ok(Judged { session: Some(Session::new(width, height, criterion, params)?) })
    }
}

impl handle::Handle for NfSession {
    const NAME: &str = "session";
}

/// A rectangle of pixels that stops as a whole. Tiles lie in rows from the top left.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NfTile {
    /// Its number: 0 to nf_session_tile_count - 1.
    pub index: usize,
    /// Left edge in pixels.
    pub x: usize,
    /// Top edge in pixels.
    pub y: usize,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
}

/// What an open tile needs next.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NfRequest {
    /// The tile.
    pub tile: NfTile,
    /// Number of the first new sample: a renderer that derives its random numbers from pixel and sample
    /// number repeats none.
    pub first: u64,
    /// New samples per pixel. Fewer or more are fine.
    pub spp: u64,
    /// For quasi-random points: which sequence of the pixel the samples belong to, 0 or 1. Scramble the two
    /// independently.
    pub sequence: u32,
    /// Index of the first new point in that sequence.
    pub point: u64,
}

impl NfSession {
    pub(crate) fn new(size: (usize, usize), judging: Judging, params: Params) -> Result<Self, Failure> {
        let judged = judging.fresh(size, params)?;
        Ok(Self { grid: judged.film().grid(), judged: Mutex::new(judged), judging })
    }

    pub(crate) fn lock(&self) -> Result<MutexGuard<'_, Judged>, Failure> {
        let locked = self.lock_any()?;
        let away = "the session judges in the background: nf_background_end gives it back";
        if locked.session.is_some() { Ok(locked) } else { Err(Failure::new(NfStatus::Argument, away)) }
    }

    fn lock_any(&self) -> Result<MutexGuard<'_, Judged>, Failure> {
        not_while_denoising()?;
        let broken = "the session cannot be used since an error inside the library";
        self.judged.lock().map_err(|_| Failure::new(NfStatus::Internal, broken))
    }

    /// Hands the session out, to judge in the background.
    pub(crate) fn lend(&self) -> Result<Session<Box<dyn StoppingCriterion + Send>>, Failure> {
        let away = || Failure::new(NfStatus::Internal, "the session is elsewhere");
        self.lock()?.session.take().ok_or_else(away)
    }

    pub(crate) fn take_back(
        &self,
        session: Session<Box<dyn StoppingCriterion + Send>>,
    ) -> Result<(), Failure> {
        self.lock_any()?.session = Some(session);
        Ok(())
    }

    /// Takes the place of what the session was.
    pub(crate) fn resume(&self, job: &str, checkpoint: Checkpoint<'_>) -> Result<(), Failure> {
        let mut locked = self.lock()?;
        let mut fresh =
            self.judging.fresh((self.grid.width(), self.grid.height()), locked.params().clone())?;
        fresh.set_pixels(locked.pixels());
        let Judged { session: Some(session) } = fresh else { return Ok(()) };
        *locked = Judged { session: Some(session.resume(job, checkpoint)?) };
        Ok(())
    }

    pub(crate) fn tile(&self, index: usize) -> Result<Tile, Failure> {
        let missing = || format!("tile {index} does not exist: there are {}", self.grid.len());
        (index < self.grid.len())
            .then(|| self.grid.tile(index))
            .ok_or_else(|| Failure::new(NfStatus::Batch, missing()))
    }
}

impl From<Tile> for NfTile {
    fn from(Tile { index, x, y, width, height }: Tile) -> Self {
        Self { index, x, y, width, height }
    }
}

impl From<Request> for NfRequest {
    fn from(Request { tile, first, spp, sequence, .. }: Request) -> Self {
        Self { tile: tile.into(), first, spp, sequence: sequence.number, point: sequence.first }
    }
}

/// Starts a session for a picture of width x height pixels: each edge up to 65536, 2^28 pixels in all. It
/// takes 36 bytes a pixel. params is NULL for the defaults. The caller frees the session with
/// nf_session_free.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_new(
    width: usize,
    height: usize,
    oracle: *const NfOracle,
    params: *const NfParams,
    session: *mut *mut NfSession,
) -> NfStatus {
    guard(|| {
        let oracle = handle::get(oracle)?;
        // SAFETY: promised by the caller.
        let params = unsafe { NfParams::or(params, Params::default()) }?;
        let make = || NfSession::new((width, height), Judging::Noise(Box::new(oracle.0.clone())), params);
        // SAFETY: promised by the caller.
        unsafe { handle::give(session, make) }
    })
}

/// As nf_session_new, for pictures that are denoised before anyone sees them: a tile is done when what denoise makes of
/// the picture has lost at most lost just-objectionable differences (JOD) against the converged one, 0.3 say, 19 of 20 tiles
/// by the vision model; nobody has been asked about denoised pictures. See also nf_session_undenoised. Both halves of the samples are denoised apart, so a
/// verdict takes two calls, on whichever thread calls nf_session_judge: params is NULL for the defaults with the schedule
/// NF_SCHEDULE_GROWING, and step and min_spp of 48. denoise and user must last as long as the session. first_hits is
/// NULL, or four pictures of floats floats each, which are copied: albedo and normal for one half, then for the other,
/// independent of each other; nf_first_hits_are_clean knows whether denoise may take them at their word. passes is 1, or 4
/// if the finished picture is made by nf_mirror_mean.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_new_denoised(
    width: usize,
    height: usize,
    denoise: NfDenoise,
    user: *mut c_void,
    lost: f64,
    first_hits: *const *const f32,
    floats: usize,
    passes: u32,
    params: *const NfParams,
    session: *mut *mut NfSession,
) -> NfStatus {
    guard(|| {
        let denoise = denoise.ok_or_else(|| Failure::new(NfStatus::NullPointer, "denoise is NULL"))?;
        if !(lost > 0.0 && lost.is_finite()) {
            let message = format!("lost must be a positive number of JOD, not {lost}");
            return Err(Failure::new(NfStatus::Argument, message));
        }
        let defaults = Params::default().with_schedule(Schedule::Growing { step: 48 }).with_min_spp(48);
        // SAFETY: promised by the caller.
        let params = unsafe { NfParams::or(params, defaults) }?;
        TileGrid::new(width, height, params.tile)?;
        let guides = match first_hits.is_null() {
            true => None,
            // SAFETY: promised by the caller.
            false => Some(Arc::new(unsafe { guides((width, height), first_hits, floats) }?)),
        };
        let passes = passes_of(passes)?;
        let judging = Judging::Denoised(DenoisedBy { denoise, user, lost, passes, guides });
        // SAFETY: promised by the caller.
        unsafe { handle::give(session, || NfSession::new((width, height), judging, params)) }
    })
}

/// Frees a session, once calls on it have returned. NULL is ignored, a second time is NF_STATUS_HANDLE.
#[unsafe(no_mangle)]
pub extern "C" fn nf_session_free(session: *mut NfSession) -> NfStatus {
    guard(|| handle::free(session))
}

/// The number of tiles; 0 if session is NULL.
#[unsafe(no_mangle)]
pub extern "C" fn nf_session_tile_count(session: *const NfSession) -> usize {
    let mut count = 0;
    guard(|| {
        count = handle::get(session)?.grid.len();
        Ok(())
    });
    count
}

/// Where a tile lies.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_tile(
    session: *const NfSession,
    index: usize,
    tile: *mut NfTile,
) -> NfStatus {
    guard(|| {
        let found = handle::get(session)?.tile(index)?;
        // SAFETY: promised by the caller.
        unsafe { border::write(tile, found.into(), "tile") }
    })
}

/// What the open tiles need next, into an array for at least as many requests as there are tiles (capacity says how
/// many). count becomes the number of requests: 0 when all tiles are done.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_requests(
    session: *const NfSession,
    requests: *mut NfRequest,
    capacity: usize,
    count: *mut usize,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        // SAFETY: promised by the caller.
        let room = unsafe { border::room(requests, capacity, session.grid.len(), "requests") }?;
        let wanted = session.lock()?.requests();
        // SAFETY: promised by the caller.
        unsafe { border::write(count, wanted.len(), "count") }?;
        room.iter_mut().zip(wanted).for_each(|(place, request)| *place = request.into());
        Ok(())
    })
}

/// Samples per pixel that the next pass over the whole picture should have, for a renderer of whole frames: what one
/// half lacks until the first of the open tiles can be judged, so that nothing has to be read back from a GPU before.
/// spp becomes 0 when all tiles are done.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_next_pass(session: *const NfSession, spp: *mut u64) -> NfStatus {
    guard(|| {
        let found = handle::get(session)?.lock()?.next_pass().unwrap_or(0);
        // SAFETY: promised by the caller.
        unsafe { border::write(spp, found, "spp") }
    })
}

/// Judges the tiles that are due. newly_done, which may be NULL, becomes the number of tiles that are now
/// done and were not before. The first verdicts wait until every open tile has samples, unless tone_mapping
/// is NF_TONE_SRGB. When the exposure of the finished picture turns out to be another than was estimated,
/// tiles that were done can be open again: render until there are no requests.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_judge(session: *const NfSession, newly_done: *mut usize) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        // A picture to settle the exposure by, and what verdicts take beside
        border::memory(session.grid, 2 * size_of::<Rgb>())?;
        let stops = session.lock()?.judge()?;
        if newly_done.is_null() {
            return Ok(());
        }
        // SAFETY: not null, and promised by the caller.
        unsafe { border::write(newly_done, stops.len(), "newly_done") }
    })
}

/// Just-objectionable differences that each tile to be shown has lost, by its last verdict: a double for each tile, NaN
/// before the first, into an array for at least as many (capacity says how many). NF_STATUS_UNAVAILABLE if the session
/// has no denoiser.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_jods_lost(
    session: *const NfSession,
    lost: *mut f64,
    capacity: usize,
) -> NfStatus {
    // SAFETY: promised by the caller.
    unsafe {
        of_tiles(session, (lost, capacity), "lost", |verdict| {
            verdict.and_then(|verdict| verdict.lost).unwrap_or(f64::NAN)
        })
    }
}

/// Which tiles are to be shown as rendered instead of denoised: their noise has lost no more than is allowed, and what the
/// denoiser makes of them has. A bool for each tile, into an array for at least as many (capacity says how
/// many); false before the first verdict. NF_STATUS_UNAVAILABLE if the session
/// has no denoiser.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_undenoised(
    session: *const NfSession,
    undenoised: *mut bool,
    capacity: usize,
) -> NfStatus {
    // SAFETY: promised by the caller.
    unsafe {
        of_tiles(session, (undenoised, capacity), "undenoised", |verdict| {
            verdict.is_some_and(|verdict| verdict.undenoised)
        })
    }
}

/// Writes what the last verdict on each tile says of the denoised picture.
unsafe fn of_tiles<T>(
    session: *const NfSession,
    (values, capacity): (*mut T, usize),
    name: &str,
    of: impl Fn(Option<Verdict>) -> T,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        // SAFETY: promised by the caller, but for the values, which need not be any before.
        let room =
            unsafe { border::room::<MaybeUninit<T>>(values.cast(), capacity, session.grid.len(), name) }?;
        let judged = session.lock()?;
        if let Judging::Noise(_) = session.judging {
            return Err(Failure::new(NfStatus::Unavailable, "the session has no denoiser"));
        }
        room.iter_mut().enumerate().for_each(|(tile, place)| _ = place.write(of(judged.verdict(tile))));
        Ok(())
    })
}
