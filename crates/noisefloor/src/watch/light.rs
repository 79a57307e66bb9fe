//! Light that cannot be: what a broken renderer sends in a well-formed batch.

use super::points;
use crate::display::luminance;
use crate::film::Film;
use crate::rgb::Rgb;
use rayon::prelude::*;
use thiserror::Error;

/// Share of a tile's pixels that may be non-finite. The film keeps single ones out, and the report counts
/// them.
const MOST_NON_FINITE: f64 = 0.5;
/// How far below zero the mean luminance of a tile may be by rounding, relative to the brightest pixel so
/// far.
const ROUNDING: f64 = 1e-3;
/// Share of a picture's pixels below zero that is worth a warning.
const BELOW_ZERO: f64 = 0.01;

/// Why a batch cannot be the light of a scene.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ImpossibleLight {
    /// Most pixels of a tile have a channel that is infinite or not a number.
    #[error(
        "{percent:.0} % of the tile's pixels are not finite; \
         look for a broken material, texture or light there"
    )]
    NotFinite {
        /// Share of the tile's pixels, in per cent.
        percent: f64,
    },
    /// The mean luminance of a tile is negative.
    #[error(
        "the tile's mean luminance is negative ({mean:.3e}); look for a broken material or light there, \
         or a filter with negative lobes"
    )]
    Negative {
        /// Mean luminance of the tile's finite pixels.
        mean: f64,
    },
}

/// Looks at the light of one source.
///
/// ```
/// let mut light = noisefloor::watch::LightCheck::default();
/// assert!(light.check(&[[0.2; 3], [0.4, 0.5, -0.01]]).is_ok());
/// assert!(light.check(&[[0.2; 3], [-1e6; 3]]).is_err());
/// ```
///
/// Single channels may be negative: colours outside Rec.709 are. Luminance is not, but for rounding, whose
/// scale is that of the brightest pixel that was accepted so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightCheck {
    brightest: f64,
}

impl LightCheck {
    /// Looks at pixels of a tile: new samples alone, which no light leaves negative.
    ///
    /// # Errors
    /// [`ImpossibleLight`].
    pub fn check(&mut self, pixels: &[Rgb]) -> Result<(), ImpossibleLight> {
        let seen = SeenLight::of(pixels.iter().copied());
        let brightest = self.brightest.max(seen.brightest);
        seen.check(brightest)?;
        // Light that was refused is no measure of what comes later
        self.brightest = brightest;
        Ok(())
    }
}

/// Whether most pixels are finite, and the light of those on average not less than none.
pub(crate) fn check(pixels: impl Iterator<Item = Rgb>) -> Result<(), ImpossibleLight> {
    SeenLight::of(pixels).by_itself()
}

/// The same of a whole picture.
pub(crate) fn check_picture(pixels: &[Rgb]) -> Result<(), ImpossibleLight> {
    // Pixels that a thread looks at
    const AT_ONCE: usize = 1 << 16;
    let parts = pixels.par_chunks(AT_ONCE).map(|part| SeenLight::of(part.iter().copied()));
    let and = |sum: SeenLight, part: SeenLight| SeenLight {
        sum: sum.sum + part.sum,
        finite: sum.finite + part.finite,
        all: sum.all + part.all,
        brightest: sum.brightest.max(part.brightest),
    };
    parts.collect::<Vec<_>>().into_iter().fold(SeenLight::default(), and).by_itself()
}

/// The share of a picture's pixels whose luminance is below zero, in per cent, if they are not few: by more than rounding
/// of what is as bright as the picture on average.
pub(super) fn negative(film: &Film) -> Option<f64> {
    let of_tile = |tile: crate::tile::Tile| {
        let pixel = film.pixels_of(tile.index);
        let light = move |(x, y)| f64::from(luminance(pixel((tile.y + y) * film.width() + tile.x + x)));
        points::compared(tile).map(light).collect::<Vec<_>>()
    };
    let light: Vec<f64> = film.grid().tiles().flat_map(of_tile).collect();
    let mean = light.iter().map(|light| light.abs()).sum::<f64>() / light.len() as f64;
    let below = light.iter().filter(|&&light| light < -ROUNDING * mean).count() as f64 / light.len() as f64;
    (below > BELOW_ZERO).then_some(100.0 * below)
}

/// What there is to see in pixels of a tile, apart from all others: luminance, where it is finite.
#[derive(Clone, Copy, Default)]
pub(crate) struct SeenLight {
    sum: f64,
    finite: usize,
    all: usize,
    brightest: f64,
}

impl SeenLight {
    pub(super) fn of(pixels: impl Iterator<Item = Rgb>) -> Self {
        let mut seen = Self::default();
        for pixel in pixels {
            seen.all += 1;
            if pixel.iter().all(|channel| channel.is_finite()) {
                let light = f64::from(luminance(pixel));
                (seen.sum, seen.finite) = (seen.sum + light, seen.finite + 1);
                seen.brightest = seen.brightest.max(light);
            }
        }
        seen
    }

    /// Beside the brightest pixel that there is to compare with.
    fn check(self, brightest: f64) -> Result<(), ImpossibleLight> {
        let Self { sum, finite, all, .. } = self;
        let lost = (all - finite) as f64 / all.max(1) as f64;
        if lost > MOST_NON_FINITE {
            return Err(ImpossibleLight::NotFinite { percent: 100.0 * lost });
        }
        let mean = sum / finite.max(1) as f64;
        if mean < -ROUNDING * brightest - f64::from(f32::EPSILON) {
            return Err(ImpossibleLight::Negative { mean });
        }
        Ok(())
    }

    /// Beside its own brightest pixel.
    pub(super) fn by_itself(self) -> Result<(), ImpossibleLight> {
        self.check(self.brightest)
    }

    /// Whether there was anything to see.
    pub(super) fn is_of_nothing(self) -> bool {
        self.all == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(before: f32, value: impl Fn(usize) -> Rgb) -> Result<(), ImpossibleLight> {
        let mut light = LightCheck::default();
        light.check(&[[before; 3]; 100]).unwrap();
        light.check(&(0..100).map(value).collect::<Vec<_>>())
    }

    #[test]
    fn most_pixels_are_finite() {
        let nan = |share: usize| move |i: usize| [0.5, if i < share { f32::NAN } else { 0.5 }, 0.5];
        assert_eq!(check(0.5, nan(83)), Err(ImpossibleLight::NotFinite { percent: 83.0 }));
        assert_eq!(check(0.5, |_| [f32::INFINITY; 3]), Err(ImpossibleLight::NotFinite { percent: 100.0 }));
        assert_eq!(check(0.5, nan(50)), Ok(()));
    }

    #[test]
    fn light_is_not_negative() {
        let seventh = |i: usize| [if i.is_multiple_of(7) { -1e6 } else { 0.5 }; 3];
        assert!(matches!(check(0.5, seventh), Err(ImpossibleLight::Negative { mean }) if mean < -1e5));
        assert!(matches!(check(0.0, |_| [-1.0; 3]), Err(ImpossibleLight::Negative { .. })));
        // A saturated green has negative red; a black tile may have been rounded below zero
        assert_eq!(check(0.5, |_| [-0.5, 0.9, -0.1]), Ok(()));
        assert_eq!(check(100.0, |_| [-1e-3; 3]), Ok(()));
        assert_eq!(check(0.0, |_| [-1e-9; 3]), Ok(()));
        assert_eq!(LightCheck::default().check(&[]), Ok(()));
    }
}
