//! What a finished picture has lost, measured beside another render of the same view.

use crate::estimate::{DenoisedError, DenoisedHalves};
use noisefloor::{Rgb, Tile, display::Display};
use noisefloor_vision::{VisionError, VisionModel, VisionWorkspace};

/// JODs grow with pooled differences to the power of 0.93 (`noisefloor_vision`), and the squares of independent differences add up.
const SQUARES: f64 = 2.0 / 0.93;

/// Just-objectionable differences that a finished picture has lost, plain or denoised, seen as a picture of its own. The other
/// render has independent samples, best some four times as many, in two halves; its own noise is taken off in two ways. What both
/// halves have in common, scale by scale, has the right strength in the shape of noise ([`DenoisedError::new`]): of blotches, it
/// finds down to two thirds. What is seen beside the mean of the halves, less what is seen of their own noise, has the right
/// shape, but more noise: it finds up to a half too much. Their mean is 0.73 to 1.31 times what was lost, from 0.1 to 2 JODs, in
/// a test with grey, blue and dotted noise. In a film, all of it is taken to be new in every frame.
///
/// Pictures are linear radiance, row-major, `size` is width and height.
///
/// # Errors
/// [`VisionError`] if a picture has another number of pixels than the size says, or the vision model does not compare as many.
pub fn jods_lost_beside(
    size: (usize, usize),
    picture: &[Rgb],
    halves: [&[Rgb]; 2],
    display: &Display,
    eyes: &VisionModel,
) -> Result<f64, VisionError> {
    let (width, height) = size;
    let [a, b] = halves;
    let other = |_| {
        let lengths = [picture, a, b].map(<[Rgb]>::len);
        let found = lengths.into_iter().find(|&found| Some(found) != width.checked_mul(height)).unwrap_or(0);
        VisionError::Length { width, height, found }
    };
    let common = DenoisedHalves { size, noisy: halves, denoised: [picture; 2] };
    let common = DenoisedError::new(&common, display).map_err(other)?.new_in_every_frame();
    let mean: Vec<Rgb> = a.iter().zip(b).map(|(a, b)| [0, 1, 2].map(|c| 0.5 * a[c] + 0.5 * b[c])).collect();
    let beside = |picture: &[Rgb]| DenoisedError::known(size, picture, &mean, display).map_err(other);
    let mut room = VisionWorkspace::default();
    let whole = Tile { index: 0, x: 0, y: 0, width, height };
    let mut lost = |error: &DenoisedError| error.jods_lost(whole, eyes, &mut room);
    let (common, beside, noise) = (lost(&common)?, lost(&beside(picture)?)?, lost(&beside(a)?)?);
    let rest = (beside.powf(SQUARES) - noise.powf(SQUARES)).max(0.0).powf(1.0 / SQUARES);
    Ok(0.5 * (common + rest))
}
