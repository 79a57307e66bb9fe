//! Open Image Denoise, in a process of its own.

use crate::denoiser::{AuxiliaryPictures, DenoiseError, Denoiser, NoisyPicture};
use noisefloor::Rgb;
use noisefloor_sidecar::{FilterPlan, PictureFilter, Renderer, SidecarError, find};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// How Open Image Denoise is installed and found: the package `mitsuba-oidn`, with the library and its
/// weights.
pub const OIDN: Renderer = Renderer {
    name: "oidn",
    title: "Open Image Denoise 2.5",
    script: include_str!("../host/oidn_host.py"),
    requirements: include_str!("../requirements.txt"),
    pythons: &[12, 11, 13, 14],
    probe: "import mitsuba_oidn; print(mitsuba_oidn.oidn_version())",
};

/// Pixels up to which two pictures are denoised at once, by one thread each: as in `oidn_host.py`.
const SMALL: usize = 512 * 512;

/// [Open Image Denoise](https://www.openimagedenoise.org) on the CPU: its filter `RT` for linear pictures, in
/// its highest quality. Pictures of up to 512×512 pixels take one thread each, larger ones four, whatever
/// [`FilterPlan::threads`] says: the last bits of its results depend on their number.
#[derive(Debug)]
pub struct Oidn(PictureFilter);

impl Oidn {
    /// Starts it in the interpreter that [`noisefloor_sidecar::find`] returns.
    ///
    /// # Errors
    /// [`SidecarError`] if it is not installed, or does not load.
    pub fn start(plan: FilterPlan) -> Result<Self, SidecarError> {
        let python = find(&OIDN).map_err(|error| SidecarError {
            renderer: OIDN.title.to_owned(),
            doing: "starting".to_owned(),
            tile: None,
            cause: Box::new(error.into()),
            last_words: String::new(),
        })?;
        Ok(Self(PictureFilter::open(&OIDN, &python, plan)?))
    }

    /// Gives a call up as soon as the flag is set; see [`PictureFilter::give_up_when`].
    pub fn give_up_when(&mut self, flag: Arc<AtomicBool>) {
        self.0.give_up_when(flag);
    }
}

impl Denoiser for Oidn {
    fn name(&self) -> String {
        self.0.name().to_owned()
    }

    fn wants(&self) -> AuxiliaryPictures {
        AuxiliaryPictures { albedo: true, normal: true }
    }

    fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError> {
        let [made] = self.apply([picture])?;
        Ok(made)
    }

    fn denoise_both(&mut self, pictures: [&NoisyPicture<'_>; 2]) -> Result<[Vec<Rgb>; 2], DenoiseError> {
        let (width, height) = pictures[0].size;
        if width.saturating_mul(height) > SMALL {
            // One call has no room for large ones
            let [a, b] = pictures;
            return Ok([self.denoise(a)?, self.denoise(b)?]);
        }
        self.apply(pictures)
    }
}

impl Oidn {
    fn apply<const N: usize>(&mut self, all: [&NoisyPicture<'_>; N]) -> Result<[Vec<Rgb>; N], DenoiseError> {
        let size = all[0].size;
        if let Some(odd) = all.iter().find(|picture| !picture.fits() || picture.size != size) {
            return Err(DenoiseError::Pixels { size, got: odd.radiance.len() });
        }
        let frames = all.map(|picture| {
            let mut pictures = vec![("radiance", picture.radiance)];
            // Its filter takes normals only beside albedo
            if let Some(albedo) = picture.albedo {
                pictures.push(("albedo", albedo));
                pictures.extend(picture.normal.map(|normal| ("normal", normal)));
            }
            pictures
        });
        let made = self.0.apply(size, frames.each_ref().map(Vec::as_slice));
        made.map_err(|error| DenoiseError::Failed { name: self.name(), cause: Box::new(error) })
    }
}
