//! What a denoiser is.

use auto_impl::auto_impl;
use noisefloor::{Rgb, Tile, source::FirstHits};
use std::error::Error;
use std::sync::{Arc, Mutex, PoisonError};
use thiserror::Error;

/// A noisy picture, row-major, with what else is known of its pixels.
#[derive(Clone, Copy, Debug)]
pub struct NoisyPicture<'a> {
    /// Width and height in pixels.
    pub size: (usize, usize),
    /// Linear radiance, width × height values.
    pub radiance: &'a [Rgb],
    /// Colour of the surface first hit, in [0, 1], as many values.
    pub albedo: Option<&'a [Rgb]>,
    /// Its normal, each component in [−1, 1], as many values.
    pub normal: Option<&'a [Rgb]>,
    /// Whether albedo and normals have no noise that could be seen: what they show may be taken at its word.
    pub clean: bool,
}

impl<'a> NoisyPicture<'a> {
    /// A picture of which only the radiance is known.
    pub fn new(size: (usize, usize), radiance: &'a [Rgb]) -> Self {
        Self { size, radiance, albedo: None, normal: None, clean: false }
    }

    /// The same with those of the first hits that the denoiser makes use of; whether they are clean,
    /// [`Guides::is_clean`](crate::Guides::is_clean) knows.
    #[must_use]
    pub fn guided(self, hits: &'a FirstHits, clean: bool, wants: AuxiliaryPictures) -> Self {
        let albedo = wants.albedo.then_some(hits.albedo.as_slice());
        Self { albedo, normal: wants.normal.then_some(hits.normal.as_slice()), clean, ..self }
    }

    /// Whether all pictures have as many pixels as the size says.
    pub fn fits(&self) -> bool {
        let fits = |picture: &[Rgb]| self.size.0.checked_mul(self.size.1) == Some(picture.len());
        fits(self.radiance) && [self.albedo, self.normal].into_iter().flatten().all(fits)
    }
}

/// Which auxiliary pictures a denoiser makes use of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AuxiliaryPictures {
    /// [`NoisyPicture::albedo`].
    pub albedo: bool,
    /// [`NoisyPicture::normal`].
    pub normal: bool,
}

impl AuxiliaryPictures {
    /// Whether it makes use of any.
    pub fn any(self) -> bool {
        self.albedo || self.normal
    }
}

/// Why a picture could not be denoised.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DenoiseError {
    /// A picture has another number of pixels than its size says.
    #[error("a picture to denoise has {got} pixels, not {}×{}", size.0, size.1)]
    Pixels {
        /// Width and height.
        size: (usize, usize),
        /// Pixels of the radiance.
        got: usize,
    },
    /// The denoiser failed.
    #[error("{name} cannot denoise the picture")]
    Failed {
        /// The denoiser.
        name: String,
        /// Why.
        #[source]
        cause: Box<dyn Error + Send + Sync>,
    },
}

/// Turns a noisy picture into one that people look at.
///
/// # Example
/// ```
/// use noisefloor::{Params, Rgb, Session};
/// use noisefloor_denoise::{DEFAULT_JODS_LOST, DenoiseError, DenoisedQuality, Denoiser, NoisyPicture};
///
/// /// The mean of each pixel and its neighbours in the row.
/// struct Blur;
///
/// impl Denoiser for Blur {
///     fn name(&self) -> String {
///         "blur of three pixels".into()
///     }
///
///     fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError> {
///         let rows = picture.radiance.chunks_exact(picture.size.0);
///         let blurred = |row: &[Rgb], x: usize| {
///             let near = &row[x.saturating_sub(1)..(x + 2).min(row.len())];
///             std::array::from_fn(|c| near.iter().map(|pixel| pixel[c]).sum::<f32>() / near.len() as f32)
///         };
///         Ok(rows.flat_map(|row| (0..row.len()).map(move |x| blurred(row, x))).collect())
///     }
/// }
///
/// // Tiles stop when their denoised picture has lost no more than is allowed
/// let criterion = DenoisedQuality::new(Blur, DEFAULT_JODS_LOST);
/// let session = Session::new(128, 128, criterion, Params::default().with_tile(64))?;
/// assert_eq!(session.open_tiles(), 4);
/// # Ok::<(), noisefloor::SessionError>(())
/// ```
///
/// # For implementers
/// - The result depends on the picture alone: the same picture gives the same result, whatever was denoised
///   before. A half buffer must not influence how the other one is denoised, or the measured error is too
///   small.
/// - Return as many pixels, linear and finite.
/// - Use auxiliary pictures only if they are there, and expect noise in them unless they are
///   [`clean`](NoisyPicture::clean).
#[auto_impl(&mut, Box)]
pub trait Denoiser {
    /// Its name and version, and all settings that its results depend on.
    fn name(&self) -> String;

    /// What it makes use of besides the radiance: nothing, unless it says so.
    fn wants(&self) -> AuxiliaryPictures {
        AuxiliaryPictures::default()
    }

    /// Denoises a picture of linear radiance.
    ///
    /// # Errors
    /// [`DenoiseError`] if the pictures differ in size, or the denoiser fails.
    fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError>;

    /// Denoises two pictures of the same size, each as if it were alone; at once, where that saves time.
    ///
    /// # Errors
    /// As for one.
    fn denoise_both(&mut self, pictures: [&NoisyPicture<'_>; 2]) -> Result<[Vec<Rgb>; 2], DenoiseError> {
        let [a, b] = pictures;
        Ok([self.denoise(a)?, self.denoise(b)?])
    }

    /// What [`denoise_both`](Self::denoise_both) makes, but only in `parts`, rectangles within the pictures: of each part, its
    /// pixels in both pictures, row-major. Parts come out as in the whole, up to far less than noise.
    ///
    /// Denoises everything and cuts the parts out, unless an implementer knows how much around a part has a say in it.
    ///
    /// # Errors
    /// As for one.
    fn denoise_parts(
        &mut self,
        pictures: [&NoisyPicture<'_>; 2],
        parts: &[Tile],
    ) -> Result<Vec<[Vec<Rgb>; 2]>, DenoiseError> {
        let size = pictures[0].size;
        let made = self.denoise_both(pictures)?;
        if let Some(odd) = made.iter().find(|made| size.0.checked_mul(size.1) != Some(made.len())) {
            return Err(DenoiseError::Pixels { size, got: odd.len() });
        }
        Ok(parts.iter().map(|&part| made.each_ref().map(|made| cut(made, size.0, part))).collect())
    }

    /// Takes the noise out of albedo and normals themselves, so that they are clean; `None` if it cannot, as it says
    /// unless an implementer knows better.
    ///
    /// # Errors
    /// As for a picture.
    fn prefilter(&mut self, hits: &FirstHits) -> Result<Option<FirstHits>, DenoiseError> {
        let _ = hits;
        Ok(None)
    }
}

/// A rectangle of a plane that is `width` pixels wide; of an empty one, nothing.
pub(crate) fn cut<T: Copy>(plane: &[T], width: usize, part: Tile) -> Vec<T> {
    if plane.is_empty() {
        return Vec::new();
    }
    part.rows(width).flat_map(|row| &plane[row]).copied().collect()
}

/// One denoiser for a criterion and for whoever writes the picture.
impl<D: Denoiser> Denoiser for Arc<Mutex<D>> {
    fn name(&self) -> String {
        self.lock().unwrap_or_else(PoisonError::into_inner).name()
    }

    fn wants(&self) -> AuxiliaryPictures {
        self.lock().unwrap_or_else(PoisonError::into_inner).wants()
    }

    fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError> {
        self.lock().unwrap_or_else(PoisonError::into_inner).denoise(picture)
    }

    fn denoise_both(&mut self, pictures: [&NoisyPicture<'_>; 2]) -> Result<[Vec<Rgb>; 2], DenoiseError> {
        self.lock().unwrap_or_else(PoisonError::into_inner).denoise_both(pictures)
    }

    fn denoise_parts(
        &mut self,
        pictures: [&NoisyPicture<'_>; 2],
        parts: &[Tile],
    ) -> Result<Vec<[Vec<Rgb>; 2]>, DenoiseError> {
        self.lock().unwrap_or_else(PoisonError::into_inner).denoise_parts(pictures, parts)
    }

    fn prefilter(&mut self, hits: &FirstHits) -> Result<Option<FirstHits>, DenoiseError> {
        self.lock().unwrap_or_else(PoisonError::into_inner).prefilter(hits)
    }
}
