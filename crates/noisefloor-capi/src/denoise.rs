//! A function of C as a denoiser.

use crate::border;
use crate::status::{DENOISING, Failure, NfStatus, guard};
use noisefloor::{Params, Rgb, TileGrid, source::FirstHits};
use noisefloor_denoise::{
    AuxiliaryPictures, DEFAULT_JODS_LOST, DenoiseError, DenoisePasses, DenoisedQuality, Denoiser, Guides,
    MirrorMean, NoisyPicture,
};
use std::error::Error;
use std::ffi::c_void;
use std::sync::Arc;

/// Denoises a whole picture, noisy, into denoised: each has 3 * width * height floats. albedo and normal are NULL, or
/// as large. What it writes hangs on these arguments alone. Returns 0, or anything else if it failed. It cannot use
/// sessions, and must not throw: an exception that leaves it ends the program.
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
    pub(crate) passes: DenoisePasses,
    pub(crate) guides: Option<Arc<Guides>>,
}

// SAFETY: `user` is only handed back, and the header says that any thread that judges may do so.
unsafe impl Send for DenoisedBy {}
// SAFETY: whoever shares it can only copy it.
unsafe impl Sync for DenoisedBy {}

impl DenoisedBy {
    pub(crate) fn quality(&self) -> DenoisedQuality<Self> {
        let quality = DenoisedQuality::new(self.clone(), self.lost).shown_as_mean_of(self.passes);
        match &self.guides {
            Some(guides) => quality.guided_by(Arc::clone(guides)),
            None => quality,
        }
    }
}

impl Denoiser for DenoisedBy {
    fn name(&self) -> String {
        "a function of C".to_owned()
    }

    fn wants(&self) -> AuxiliaryPictures {
        let guided = self.guides.is_some();
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

pub(crate) fn passes_of(count: u32) -> Result<DenoisePasses, Failure> {
    let why = || Failure::new(NfStatus::Argument, format!("passes must be 1 or 4, not {count}"));
    DenoisePasses::new(count as usize).ok_or_else(why)
}

/// Albedo and normals of both halves.
///
/// # Safety
/// `first_hits` is null, or leads to four pictures that are null, or have `floats` floats each.
pub(crate) unsafe fn guides(
    (width, height): (usize, usize),
    first_hits: *const *const f32,
    floats: usize,
) -> Result<Guides, Failure> {
    // SAFETY: promised by the caller.
    let pictures = unsafe { border::array(first_hits, 4, 4, "first_hits") }?;
    // SAFETY: promised by the caller.
    let pixels = |picture| unsafe { plane((width, height), picture, floats, "first_hits") };
    let half = |albedo, normal| -> Result<FirstHits, Failure> {
        Ok(FirstHits::new((width, height), pixels(albedo)?, pixels(normal)?))
    };
    Ok(Guides::new([half(pictures[0], pictures[1])?, half(pictures[2], pictures[3])?]))
}

/// The pixels of a picture, which are finite.
///
/// # Safety
/// `picture` is null, or has `floats` floats.
unsafe fn plane(
    (width, height): (usize, usize),
    picture: *const f32,
    floats: usize,
    what: &'static str,
) -> Result<Vec<Rgb>, Failure> {
    // SAFETY: promised by the caller.
    let values = unsafe { border::array(picture, floats, 3 * width * height, what) }?;
    if !values.iter().all(|value| value.is_finite()) {
        return Err(Failure::new(NfStatus::Argument, format!("{what}: a value is not finite")));
    }
    Ok(values.as_chunks().0.to_vec())
}

/// Whether a denoiser may take albedo and normals at their word (cleanAux of Open Image Denoise): whether the noise by which
/// both halves differ is too little to be seen in a denoised picture. first_hits as in nf_session_new_denoised.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_first_hits_are_clean(
    width: usize,
    height: usize,
    first_hits: *const *const f32,
    floats: usize,
    clean: *mut bool,
) -> NfStatus {
    guard(|| {
        TileGrid::new(width, height, Params::default().tile)?;
        // SAFETY: promised by the caller.
        let answer = unsafe { guides((width, height), first_hits, floats) }?.is_clean();
        // SAFETY: promised by the caller.
        unsafe { border::write(clean, answer, "clean") }
    })
}

/// Writes into denoised the mean of what denoise makes of a picture and of its mirror images: it has less of what denoisers get
/// wrong by chance. albedo and normal are NULL, or mirrored with it. All pictures have floats floats, 3 * width * height.
/// passes is 1 or 4.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_mirror_mean(
    width: usize,
    height: usize,
    denoise: NfDenoise,
    user: *mut c_void,
    passes: u32,
    noisy: *const f32,
    albedo: *const f32,
    normal: *const f32,
    denoised: *mut f32,
    floats: usize,
) -> NfStatus {
    guard(|| {
        let denoise = denoise.ok_or_else(|| Failure::new(NfStatus::NullPointer, "denoise is NULL"))?;
        // Sums, the picture, and two mirror images of three planes each
        border::memory(TileGrid::new(width, height, Params::default().tile)?, 160)?;
        let (passes, size) = (passes_of(passes)?, (width, height));
        // SAFETY: promised by the caller.
        let radiance = unsafe { plane(size, noisy, floats, "noisy") }?;
        let guide = |picture: *const f32, what| match picture.is_null() {
            true => Ok(None),
            // SAFETY: promised by the caller.
            false => unsafe { plane(size, picture, floats, what) }.map(Some),
        };
        let (albedo, normal) = (guide(albedo, "albedo")?, guide(normal, "normal")?);
        let picture = NoisyPicture {
            albedo: albedo.as_deref(),
            normal: normal.as_deref(),
            ..NoisyPicture::new(size, &radiance)
        };
        let by = DenoisedBy { denoise, user, lost: DEFAULT_JODS_LOST, passes, guides: None };
        let failed = |error: DenoiseError| {
            let cause = error.source().map(|cause| format!(": {cause}")).unwrap_or_default();
            Failure::new(NfStatus::Criterion, format!("{error}{cause}"))
        };
        let made = MirrorMean::new(by, passes).denoise(&picture).map_err(failed)?;
        // SAFETY: promised by the caller.
        let out = unsafe { border::array_mut(denoised, floats, 3 * width * height, "denoised") }?;
        out.copy_from_slice(made.as_flattened());
        Ok(())
    })
}
