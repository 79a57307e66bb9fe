//! Sessions that judge the picture that a function of C denoises.

use crate::border;
use crate::handle;
use crate::params::NfParams;
use crate::session::{Judging, NfSession};
use crate::status::{Failure, NfStatus, guard};
use noisefloor::{Params, Rgb, Schedule, TileGrid, source::FirstHits};
use noisefloor_denoise::{
    AuxiliaryPictures, DenoiseError, DenoisedQuality, DenoisedRecord, Denoiser, NoisyPicture,
};
use std::cell::Cell;
use std::ffi::c_void;
use std::mem::MaybeUninit;
use std::sync::{Arc, PoisonError};

/// Denoises a whole picture, noisy, into denoised: each has 3 * width * height floats. albedo and normal are NULL, or
/// as large. What it writes hangs on these arguments alone. Returns 0, or anything else if it failed. It cannot use
/// sessions.
pub type NfDenoise = Option<
    unsafe extern "C" fn(
        user: *mut c_void,
        width: u32,
        height: u32,
        noisy: *const f32,
        albedo: *const f32,
        normal: *const f32,
        denoised: *mut f32,
    ) -> i32,
>;

/// What [`nf_session_new_denoised`] was given.
#[derive(Clone)]
pub(crate) struct DenoisedBy {
    denoise: unsafe extern "C" fn(*mut c_void, u32, u32, *const f32, *const f32, *const f32, *mut f32) -> i32,
    user: *mut c_void,
    lost: f64,
    first_hits: Option<Arc<[FirstHits; 2]>>,
}

// SAFETY: `user` is only handed back, and the header says that any thread that judges may do so.
unsafe impl Send for DenoisedBy {}
// SAFETY: whoever shares it can only copy it.
unsafe impl Sync for DenoisedBy {}

impl DenoisedBy {
    pub(crate) fn quality(&self) -> DenoisedQuality<Self> {
        let quality = DenoisedQuality::new(self.clone(), self.lost);
        match &self.first_hits {
            Some(first_hits) => quality.guided_by(Arc::clone(first_hits)),
            None => quality,
        }
    }
}

thread_local! {
    /// Whether this thread is inside a denoiser, whose session waits for it.
    static DENOISING: Cell<bool> = const { Cell::new(false) };
}

pub(crate) fn not_while_denoising() -> Result<(), Failure> {
    match DENOISING.get() {
        true => {
            Err(Failure::new(NfStatus::Argument, "a denoiser cannot use sessions: one of them waits for it"))
        }
        false => Ok(()),
    }
}

impl Denoiser for DenoisedBy {
    fn name(&self) -> String {
        "a function of C".to_owned()
    }

    fn wants(&self) -> AuxiliaryPictures {
        let guided = self.first_hits.is_some();
        AuxiliaryPictures { albedo: guided, normal: guided }
    }

    fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError> {
        let (width, height) = picture.size;
        let mut denoised: Vec<Rgb> = vec![[0.0; 3]; width * height];
        let floats =
            |pixels: Option<&[Rgb]>| pixels.map_or(std::ptr::null(), |pixels| pixels.as_flattened().as_ptr());
        DENOISING.set(true);
        // SAFETY: each picture has as many floats as the function is told; the rest is its promise.
        let status = unsafe {
            (self.denoise)(
                self.user,
                width as u32,
                height as u32,
                floats(Some(picture.radiance)),
                floats(picture.albedo),
                floats(picture.normal),
                denoised.as_flattened_mut().as_mut_ptr(),
            )
        };
        DENOISING.set(false);
        let failed = |cause: String| DenoiseError::Failed { name: self.name(), cause: cause.into() };
        match (status, denoised.as_flattened().iter().all(|value| value.is_finite())) {
            (0, true) => Ok(denoised),
            (0, false) => Err(failed("it wrote a value that is not finite".to_owned())),
            (status, _) => Err(failed(format!("it returned {status}"))),
        }
    }
}

/// As nf_session_new, for pictures that are denoised before anyone sees them: a tile is done when what denoise makes of
/// the picture has lost at most lost just-objectionable differences (JOD) against the converged one, 0.3 say, 19 of 20 tiles
/// by the vision model; nobody has been asked about denoised pictures. See also nf_session_undenoised. Both halves of the samples are denoised apart, so a
/// verdict takes two calls, on whichever thread calls nf_session_judge: params is NULL for the defaults with the schedule
/// NF_SCHEDULE_GROWING, and step and min_spp of 48. denoise and user must last as long as the session. first_hits is
/// NULL, or four pictures of floats floats each, which are copied: albedo and normal for one half, then for the other,
/// independent of each other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_new_denoised(
    width: usize,
    height: usize,
    denoise: NfDenoise,
    user: *mut c_void,
    lost: f64,
    first_hits: *const *const f32,
    floats: usize,
    params: *const NfParams,
    session: *mut *mut NfSession,
) -> NfStatus {
    guard(|| {
        let denoise = denoise.ok_or_else(|| Failure::new(NfStatus::NullPointer, "denoise is NULL"))?;
        if !(lost > 0.0 && lost.is_finite()) {
            let message = format!("lost must be a positive number of JOD, not {lost}");
            return Err(Failure::new(NfStatus::Argument, message));
        }
        let params = if params.is_null() {
            Params::default().with_schedule(Schedule::Growing { step: 48 }).with_min_spp(48)
        } else {
            // SAFETY: not null, and promised by the caller.
            unsafe { border::object(params, "params")?.to_params() }?
        };
        TileGrid::new(width, height, params.tile)?;
        let first_hits = if first_hits.is_null() {
            None
        } else {
            // SAFETY: promised by the caller.
            let pictures = unsafe { border::array(first_hits, 4, 4, "first_hits") }?;
            let pixels = |picture: *const f32| -> Result<Vec<Rgb>, Failure> {
                // SAFETY: promised by the caller.
                let values = unsafe { border::array(picture, floats, 3 * width * height, "first_hits") }?;
                if !values.iter().all(|value| value.is_finite()) {
                    return Err(Failure::new(NfStatus::Argument, "first_hits: a value is not finite"));
                }
                Ok(values.as_chunks().0.to_vec())
            };
            let half = |albedo, normal| -> Result<FirstHits, Failure> {
                Ok(FirstHits { width, height, albedo: pixels(albedo)?, normal: pixels(normal)? })
            };
            Some(Arc::new([half(pictures[0], pictures[1])?, half(pictures[2], pictures[3])?]))
        };
        let judging = Judging::Denoised(DenoisedBy { denoise, user, lost, first_hits });
        // SAFETY: promised by the caller.
        unsafe { handle::give(session, || NfSession::new((width, height), judging, params)) }
    })
}

/// Just-objectionable differences that each tile to be shown has lost, by its last verdict: a double for each tile, NaN
/// before the first. NF_STATUS_UNAVAILABLE if the session has no denoiser.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_jods_lost(
    session: *const NfSession,
    lost: *mut f64,
    capacity: usize,
) -> NfStatus {
    // SAFETY: promised by the caller.
    unsafe {
        of_tiles(session, (lost, capacity), "lost", |record, tile| {
            record.jods_lost.get(tile).copied().unwrap_or(f64::NAN)
        })
    }
}

/// Which tiles are to be shown as rendered instead of denoised: their noise has lost no more than is allowed, and what the
/// denoiser makes of them has. A bool for each tile; false before the first verdict. NF_STATUS_UNAVAILABLE if the session
/// has no denoiser.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_undenoised(
    session: *const NfSession,
    undenoised: *mut bool,
    capacity: usize,
) -> NfStatus {
    // SAFETY: promised by the caller.
    unsafe {
        of_tiles(session, (undenoised, capacity), "undenoised", |record, tile| {
            record.undenoised.get(tile) == Some(&true)
        })
    }
}

/// Writes what is recorded of each tile.
unsafe fn of_tiles<T>(
    session: *const NfSession,
    (values, capacity): (*mut T, usize),
    name: &str,
    of: impl Fn(&DenoisedRecord, usize) -> T,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        // SAFETY: promised by the caller, but for the values, which need not be any before.
        let room = unsafe {
            border::array_mut::<MaybeUninit<T>>(values.cast(), capacity, session.grid.len(), name)
        }?;
        let judged = session.lock()?;
        let record = judged.record.as_ref();
        let record =
            record.ok_or_else(|| Failure::new(NfStatus::Unavailable, "the session has no denoiser"))?;
        let record = record.lock().unwrap_or_else(PoisonError::into_inner);
        room.iter_mut().enumerate().for_each(|(tile, place)| _ = place.write(of(&record, tile)));
        Ok(())
    })
}
