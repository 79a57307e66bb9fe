//! A function of C as a denoiser.

use crate::status::DENOISING;
use noisefloor::{Rgb, source::FirstHits};
use noisefloor_denoise::{AuxiliaryPictures, DenoiseError, DenoisedQuality, Denoiser, NoisyPicture};
use std::ffi::c_void;
use std::sync::Arc;

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
    pub(crate) denoise:
        unsafe extern "C" fn(*mut c_void, u32, u32, *const f32, *const f32, *const f32, *mut f32) -> i32,
    pub(crate) user: *mut c_void,
    pub(crate) lost: f64,
    pub(crate) first_hits: Option<Arc<[FirstHits; 2]>>,
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
