//! Open Image Denoise, in a process of its own.

use crate::denoiser::{AuxiliaryPictures, DenoiseError, Denoiser, NoisyPicture, cut};
use crate::parts::{grown, nearly_all, whole, within};
use noisefloor::{Rgb, Tile, display::luminance, source::FirstHits};
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
/// So many pixels around a part have a say in it: with 96, parts come out as in the whole to the last digit, with 64 they differ
/// by a hundredth of what twice as many samples change.
const CONTEXT: usize = 64;
/// Its network halves the picture four times: parts begin where the whole would be halved as well.
const ALIGNMENT: usize = 16;
/// The grey that the log-average luminance is brought to before its network looks, as it does by itself: of squares of about so
/// many pixels, but for those that are black.
const GREY: f32 = 0.18;
const METERED: usize = 16;
const BLACK: f32 = 1e-8;

/// [Open Image Denoise](https://www.openimagedenoise.org), on the CPU unless [`FilterPlan::device`] says otherwise: its filter `RT` for linear pictures, in
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

    /// What the user should know, such as why no GPU denoises.
    pub fn warnings(&self) -> &[String] {
        self.0.warnings()
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
        let [made] = self.part([picture], [gain(picture)], whole(picture.size))?;
        Ok(made)
    }

    fn denoise_both(&mut self, pictures: [&NoisyPicture<'_>; 2]) -> Result<[Vec<Rgb>; 2], DenoiseError> {
        self.both(pictures, pictures.map(gain), whole(pictures[0].size))
    }

    fn denoise_parts(
        &mut self,
        pictures: [&NoisyPicture<'_>; 2],
        parts: &[Tile],
    ) -> Result<Vec<[Vec<Rgb>; 2]>, DenoiseError> {
        let (size, gains) = (pictures[0].size, pictures.map(gain));
        let wider: Vec<Tile> = parts.iter().map(|&part| aligned(grown(part, CONTEXT, size))).collect();
        if nearly_all(&wider, size) {
            let made = self.denoise_both(pictures)?;
            return Ok(parts
                .iter()
                .map(|&part| made.each_ref().map(|made| cut(made, size.0, part)))
                .collect());
        }
        let both = |(&part, wide): (&Tile, Tile)| {
            let made = self.both(pictures, gains, wide)?;
            Ok(made.each_ref().map(|made| cut(made, wide.width, within(part, wide))))
        };
        parts.iter().zip(wider).map(both).collect()
    }

    fn prefilter(&mut self, hits: &FirstHits) -> Result<Option<FirstHits>, DenoiseError> {
        let mut one = |name: &str, plane: &[Rgb]| -> Result<Vec<Rgb>, DenoiseError> {
            let size = (hits.width, hits.height);
            let [made] = self.0.apply(size, [&[(name, plane)]]).map_err(|error| self.failed(error))?;
            Ok(made)
        };
        let (albedo, normal) = (one("albedo", &hits.albedo)?, one("normal", &hits.normal)?);
        Ok(Some(FirstHits::new((hits.width, hits.height), albedo, normal)))
    }
}

impl Oidn {
    fn failed(&self, error: SidecarError) -> DenoiseError {
        DenoiseError::Failed { name: self.name(), cause: Box::new(error) }
    }

    /// Two pictures of one size, or the same part of both.
    fn both(
        &mut self,
        [a, b]: [&NoisyPicture<'_>; 2],
        gains: [f32; 2],
        part: Tile,
    ) -> Result<[Vec<Rgb>; 2], DenoiseError> {
        if part.pixels() <= SMALL {
            return self.part([a, b], gains, part);
        }
        // One call has no room for large ones
        let ([a], [b]) = (self.part([a], [gains[0]], part)?, self.part([b], [gains[1]], part)?);
        Ok([a, b])
    }

    /// Parts of pictures of one size, whose radiance the network sees times these gains.
    fn part<const N: usize>(
        &mut self,
        all: [&NoisyPicture<'_>; N],
        gains: [f32; N],
        part: Tile,
    ) -> Result<[Vec<Rgb>; N], DenoiseError> {
        let size = all[0].size;
        if let Some(odd) = all.iter().find(|picture| !picture.fits() || picture.size != size) {
            return Err(DenoiseError::Pixels { size, got: odd.radiance.len() });
        }
        let cut = |plane: &[Rgb]| cut(plane, size.0, part);
        let frames: [Vec<(&str, Vec<Rgb>)>; N] = std::array::from_fn(|n| {
            let mut radiance = cut(all[n].radiance);
            radiance.as_flattened_mut().iter_mut().for_each(|value| *value *= gains[n]);
            let mut pictures = vec![("radiance", radiance)];
            // Its filter takes normals only beside albedo
            let names = if all[n].clean { ["clean albedo", "clean normal"] } else { ["albedo", "normal"] };
            if let Some(albedo) = all[n].albedo {
                pictures.push((names[0], cut(albedo)));
                pictures.extend(all[n].normal.map(|normal| (names[1], cut(normal))));
            }
            pictures
        });
        let named = frames.each_ref().map(|pictures| -> Vec<(&str, &[Rgb])> {
            pictures.iter().map(|(name, picture)| (*name, picture.as_slice())).collect()
        });
        let made = self.0.apply((part.width, part.height), named.each_ref().map(Vec::as_slice));
        let mut made = made.map_err(|error| self.failed(error))?;
        for (made, gain) in made.iter_mut().zip(gains) {
            made.as_flattened_mut().iter_mut().for_each(|value| *value /= gain);
        }
        Ok(made)
    }
}

/// What a picture's radiance is multiplied by for the network: parts have that of the whole.
fn gain(picture: &NoisyPicture<'_>) -> f32 {
    let (width, height) = picture.size;
    let (across, down) = (width.div_ceil(METERED), height.div_ceil(METERED));
    let (mut sum, mut count) = (0.0_f64, 0_u32);
    for (i, j) in (0..down).flat_map(|i| (0..across).map(move |j| (i, j))) {
        let (x, y) = (j * width / across, i * height / down);
        let (right, bottom) = ((j + 1) * width / across, (i + 1) * height / down);
        let square = Tile { index: 0, x, y, width: right - x, height: bottom - y };
        let light = square.rows(width).flatten().filter_map(|pixel| picture.radiance.get(pixel));
        let mean = light.map(|&pixel| luminance(pixel)).sum::<f32>() / square.pixels() as f32;
        if mean > BLACK && mean.is_finite() {
            (sum, count) = (sum + f64::from(mean).ln(), count + 1);
        }
    }
    let gain = f64::from(GREY) / (sum / f64::from(count)).exp();
    if count > 0 && gain.is_normal() { gain as f32 } else { 1.0 }
}

/// The same and a little more, to the left and above, so that it begins at a multiple of [`ALIGNMENT`].
fn aligned(part: Tile) -> Tile {
    let (left, above) = (part.x % ALIGNMENT, part.y % ALIGNMENT);
    Tile {
        x: part.x - left,
        y: part.y - above,
        width: part.width + left,
        height: part.height + above,
        ..part
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gain_makes_what_is_not_black_grey() {
        let size = (48, 33);
        let of = |radiance: &[Rgb]| gain(&NoisyPicture::new(size, radiance));
        let half = |other: f32| -> Vec<Rgb> {
            (0..size.0 * size.1).map(|i| [if i / size.0 < 11 { 0.5 } else { other }; 3]).collect()
        };
        assert!((of(&half(0.5)) - 0.36).abs() < 1e-6);
        assert!((of(&half(0.0)) - 0.36).abs() < 1e-6);
        // The geometric mean of one third and two thirds
        assert!((of(&half(0.004)) / (0.18 / 0.02) - 1.0).abs() < 1e-5);
        // Nothing to go by
        assert_eq!([0.0, f32::NAN, -1.0].map(|grey| of(&vec![[grey; 3]; 48 * 33])), [1.0; 3]);
    }
}
