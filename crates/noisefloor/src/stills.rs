//! Pictures rendered elsewhere: compared, described and judged.

use crate::criterion::{CriterionError, OpenFor, Verdict};
use crate::descriptor::Described;
use crate::display::exposure::{self, NoisyPixel};
use crate::display::{Display, ToneMapping, luminance};
pub use crate::evidence::{Evidence, Samples};
use crate::evidence::{Rendering, TilePlanes, middle_and_difference, residual_scale};
use crate::film::Film;
use crate::nested::shared_samples;
use crate::oracle::{Judged, Oracle};
use crate::params::Audience;
use crate::rgb::Rgb;
use crate::tile::{Tile, TileGrid, TilePixels};
use crate::unmet::Unmet;
use crate::watch::Encoding;
use noisefloor_vision::Viewing;
use rayon::prelude::*;
use std::borrow::Cow;
use thiserror::Error;

mod notice;
mod origin;
use origin::OriginRelation;
pub use origin::SampleOrigin;

/// Pixels that a thread looks at.
const AT_ONCE: usize = 1 << 16;

/// A picture with its samples per pixel.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Still {
    /// Width and height in pixels.
    pub size: (usize, usize),
    /// Linear radiance, row-major, width × height values, all finite.
    pub pixels: Vec<Rgb>,
    /// Samples per pixel, above 0.
    pub spp: f64,
    /// Whether it is displayed unchanged instead of tone mapped: a PNG.
    pub display_referred: bool,
    /// Variance of the rounding of its display values; 0 for pictures in floating point.
    pub rounding: f32,
    /// Where its samples come from, if its file says so.
    pub origin: Option<SampleOrigin>,
}

/// Why pictures cannot be compared.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StillError {
    /// The samples per pixel are not a positive number.
    #[error("a positive number of samples per pixel is needed, not {0}")]
    Spp(f64),
    /// The pixels do not fit the size, or there are none.
    #[error("a picture of {}×{} pixels has {got}: it needs one at least, and as many as its size says", size.0, size.1)]
    Pixels {
        /// Width and height.
        size: (usize, usize),
        /// Pixels that there are.
        got: usize,
    },
    /// A tile that does not lie in the picture.
    #[error("a tile of {}×{} pixels at ({}, {}) does not lie in a picture of {}×{}",
        tile.width, tile.height, tile.x, tile.y, size.0, size.1)]
    Tile {
        /// The tile.
        tile: Tile,
        /// Width and height of the picture.
        size: (usize, usize),
    },
    /// A pixel is not finite.
    #[error("pixel ({x}, {y}) is not finite; repair the render or paint over the pixel first")]
    NotFinite {
        /// Its column.
        x: usize,
        /// Its row.
        y: usize,
    },
    /// Two views, or two resolutions.
    #[error("the pictures have different sizes, {}×{} and {}×{}", image.0, image.1, other.0, other.1)]
    Sizes {
        /// Of one.
        image: (usize, usize),
        /// Of the other.
        other: (usize, usize),
    },
    /// Shown in two ways.
    #[error("one is a PNG and one an EXR; compare pictures of one kind")]
    Kinds,
    /// Two copies of one picture.
    #[error("the pictures are identical, so that nothing shows their noise; render one with another seed")]
    Same,
    /// One picture only.
    #[error(
        "nothing to compare the picture with: noise shows where two renderings of one view differ; give another rendering, \
         with another seed or more samples, or a converged reference"
    )]
    Nothing,
    /// Nested pictures with equal samples.
    #[error("nested pictures of the same {0} samples per pixel are the same picture: nothing to judge by")]
    Nested(f64),
    /// The pictures do not show whether they share samples.
    #[error(
        "the pictures of {image} and {other} samples per pixel do not show whether one contains the samples of the other; \
         say whether they are nested (stages of one rendering) or independent (rendered with different seeds)"
    )]
    Undecided {
        /// Samples per pixel of the picture.
        image: f64,
        /// Samples per pixel of the one it is compared with.
        other: f64,
    },
    /// The files say that the noise of the pictures is related, and not how.
    #[error(
        "both pictures come from {origin} with seed {seed}, but with other options, \
         or from a renderer that does not repeat its samples: they are made from the same random numbers, \
         and nobody can tell how much of their noise they share; render one with another seed, \
         or say whether they are nested or independent"
    )]
    Dependent {
        /// Scene and renderer.
        origin: String,
        /// Their seed.
        seed: u64,
    },
    /// Two of the pictures compared with share samples, which would count twice.
    #[error(
        "two of the pictures to compare with ({} and {} samples per pixel) are the same or share samples, \
         which would count twice; leave one out", .0[0], .0[1]
    )]
    Twice([f64; 2]),
    /// Light that cannot be.
    #[error(
        "the mean luminance of a picture is negative ({0:.3e}): light is not; \
         look for a broken material or light, or for what was subtracted from it"
    )]
    Light(f64),
    /// Two different things.
    #[error(
        "the pictures differ in brightness by more than noise explains, everywhere: \
         they are no two renderings of one view with one exposure, \
         and their difference says nothing about noise"
    )]
    Unlike,
    /// Eyes that the model cannot judge for.
    #[error("the model does not tell noise from picture, and serves only the trained audience")]
    Audience,
    /// The model does not fit the tiles.
    #[error(transparent)]
    Criterion(#[from] CriterionError),
}

/// What is likely wrong with pictures that are compared: verdicts on them come too early or too late.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum StillWarning {
    /// Their difference is no independent noise of pixels.
    #[error(
        "the noise of neighbouring pixels is correlated ({0:.2}): the pictures were denoised, blurred, \
         scaled, or rendered with a wide pixel filter; verdicts are made for independent pixels, \
         and come too early or too late"
    )]
    Neighbours(f64),
    /// One has another exposure.
    #[error(
        "the picture is {0:.2} times as bright as what it is compared with, where there is light: \
         render both with one exposure, as their difference is not noise alone"
    )]
    Brightness(f64),
    /// Tiles of another brightness.
    #[error(
        "in {tiles} of {of} tiles the pictures differ in brightness by more than noise explains, and these are not judged; \
         compare renderings of one view with one exposure"
    )]
    Unlike {
        /// How many.
        tiles: usize,
        /// Of how many.
        of: usize,
    },
    /// All values are 8-bit numbers, and differ between the pictures.
    #[error("all values are {0} of 8 bits: compare linear radiance in floating point, as it was rendered")]
    Quantised(Encoding),
    /// Noise is cut off at white, in this share of the noisy pixels, in per cent.
    #[error(
        "no value is above 1, and the noise of {0:.0} % of the noisy pixels ends there: \
         compare linear radiance, not what is shown on a screen"
    )]
    Clipped(f64),
}

/// What two pictures say against a verdict on them.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Noticed {
    /// What is likely wrong with them.
    pub warnings: Vec<StillWarning>,
    /// For each tile, whether its brightness differs between the two by more than their noise explains: by a tenth of
    /// the display's range on average, and three times the standard deviation from pixel to pixel. Renderings of one
    /// view have no such tiles, and a verdict on one means nothing.
    pub unlike: Vec<bool>,
}

impl Still {
    /// Linear radiance in floating point, of which nobody knows where its samples come from.
    pub fn new(size: (usize, usize), pixels: Vec<Rgb>, spp: f64) -> Self {
        Self { size, pixels, spp, display_referred: false, rounding: 0.0, origin: None }
    }

    /// A picture that is displayed as it is, whose display values were rounded with this variance.
    #[must_use]
    pub fn displayed_as_it_is(self, rounding: f32) -> Self {
        Self { display_referred: true, rounding, ..self }
    }

    /// The same with [`Still::origin`].
    #[must_use]
    pub fn with_origin(self, origin: Option<SampleOrigin>) -> Self {
        Self { origin, ..self }
    }

    /// Checks that there are as many pixels as the size says, that samples are positive and all pixels finite.
    ///
    /// # Errors
    /// [`StillError::Pixels`], [`StillError::Spp`], [`StillError::NotFinite`].
    pub fn check(&self) -> Result<(), StillError> {
        let (size, got) = (self.size, self.pixels.len());
        if got == 0 || size.0.checked_mul(size.1) != Some(got) {
            return Err(StillError::Pixels { size, got });
        }
        if !(self.spp.is_finite() && self.spp > 0.0) {
            return Err(StillError::Spp(self.spp));
        }
        let parts = self.pixels.par_chunks(AT_ONCE).enumerate();
        let bad = parts.find_map_first(|(n, part)| {
            let bad = part.iter().position(|p| !p.iter().all(|c| c.is_finite()))?;
            Some(n * AT_ONCE + bad)
        });
        match bad {
            Some(bad) => Err(StillError::NotFinite { x: bad % self.size.0, y: bad / self.size.0 }),
            None => Ok(()),
        }
    }

    /// Checks that this picture can be compared with another.
    ///
    /// # Errors
    /// [`StillError`] if size or kind differ, or nothing does.
    pub fn fits(&self, other: &Still) -> Result<(), StillError> {
        if self.size != other.size {
            return Err(StillError::Sizes { image: self.size, other: other.size });
        }
        if self.display_referred != other.display_referred {
            return Err(StillError::Kinds);
        }
        if self.pixels == other.pixels { Err(StillError::Same) } else { Ok(()) }
    }

    /// What the origins of both say; nothing if one has none.
    fn relation(&self, other: &Still) -> OriginRelation {
        match (&self.origin, &other.origin) {
            (Some(one), Some(other)) => one.relation(other),
            _ => OriginRelation::Unknown,
        }
    }

    fn dependent(&self) -> StillError {
        let (origin, seed) = self.origin.as_ref().map(|o| (o.source.clone(), o.seed)).unwrap_or_default();
        StillError::Dependent { origin, seed }
    }

    fn rendering(&self) -> Rendering<'_> {
        Rendering { pixels: &self.pixels, spp: self.spp, rounding: self.rounding }
    }
}

/// A picture and what it is compared with.
#[derive(Debug)]
pub struct SnapshotPair<'a> {
    /// What is judged.
    image: &'a Still,
    /// The two pictures that are held against each other: the one that is judged and another, or its two halves.
    pair: [Cow<'a, Still>; 2],
    basis: Basis<'a>,
    samples: Samples,
    display: Display,
    viewing: Viewing,
}

/// What shows the noise of the picture that is judged.
#[derive(Debug)]
enum Basis<'a> {
    /// Its difference from a converged one.
    Reference,
    /// Its difference from the other picture of the pair, which was made in this way.
    Other(Samples),
    /// Its difference from what the samples make that it does not have, of a picture which contains its own.
    Rest(Still),
    /// The difference of these two, which share no samples, and whose mean it is.
    Halves([Cow<'a, Still>; 2]),
}

impl<'a> SnapshotPair<'a> {
    /// Compares a picture with others of the same view, as models with this evidence need it. Independent
    /// renderings are pooled; of nested ones and of references, the most informative is used. `samples` says
    /// how the pictures were made; with `None`, their origins tell, and where these do not, it is recognised
    /// from the pictures, where they show it.
    ///
    /// An exposure by log-average is that of the converged picture, estimated from all samples compared;
    /// with a reference, its own.
    ///
    /// # Errors
    /// [`StillError`] if they do not fit, or there is nothing to hold the picture against.
    pub fn new(
        evidence: Evidence,
        image: &'a Still,
        others: &[&'a Still],
        tone: ToneMapping,
        samples: Option<Samples>,
    ) -> Result<Self, StillError> {
        image.check()?;
        others.iter().try_for_each(|other| other.check().and_then(|()| image.fits(other)))?;
        let (samples, others) = match samples {
            _ if evidence != Evidence::Halves => (Samples::Independent, others.to_vec()),
            Some(samples) => (samples, others.to_vec()),
            None if image.display_referred => recognise(image, others, &Display::SRGB)?,
            None => recognise(image, others, &settle_noisy(&tone, image))?,
        };
        if evidence == Evidence::Halves && samples == Samples::Independent {
            check_apart(&others)?;
        }
        let others = others.as_slice();
        let other = match evidence {
            Evidence::Halves => pool(others, image.spp, samples),
            Evidence::Reference => {
                others.iter().max_by(|a, b| a.spp.total_cmp(&b.spp)).map(|cleanest| Cow::Borrowed(*cleanest))
            }
        };
        let other = other.ok_or(StillError::Nothing)?;
        let display = match evidence {
            _ if image.display_referred => Display::SRGB,
            Evidence::Reference => tone.settle(&other.pixels),
            Evidence::Halves => settle(&tone, image, &other, samples),
        };
        let basis = match evidence {
            Evidence::Reference => Basis::Reference,
            // Of a picture that was cut off at white nobody knows what its other samples were
            Evidence::Halves if samples == Samples::Independent || image.display_referred => {
                Basis::Other(samples)
            }
            Evidence::Halves if image.spp == other.spp => Basis::Other(samples),
            Evidence::Halves if image.spp < other.spp => Basis::Rest(rest(&other, image)),
            Evidence::Halves => Basis::Halves([Cow::Owned(rest(image, &other)), other.clone()]),
        };
        let pair = [Cow::Borrowed(image), other];
        Ok(Self { image, pair, basis, samples, display, viewing: Viewing::default() })
    }

    /// The mean of two pictures that share no samples, of which it is made up to the bit as a film makes it up from its
    /// halves.
    pub(crate) fn of_halves(mean: &'a Still, halves: [&'a Still; 2], tone: &ToneMapping) -> Self {
        let [a, b] = halves;
        let display = settle(tone, a, b, Samples::Independent);
        let (pair, basis) = (halves.map(Cow::Borrowed), Basis::Halves(halves.map(Cow::Borrowed)));
        Self { image: mean, pair, basis, samples: Samples::Nested, display, viewing: Viewing::default() }
    }

    /// The same pictures on this display, from this far; without it, [`Viewing::default`].
    pub fn seen_on(self, viewing: Viewing) -> Self {
        Self { viewing, ..self }
    }

    /// Whether the pictures share samples.
    pub fn samples(&self) -> Samples {
        self.samples
    }

    /// Samples per pixel of the picture. Fewer than one count as one: see [`SnapshotPair::judge`].
    pub fn image_spp(&self) -> f64 {
        self.image.spp
    }

    /// How the picture is shown.
    pub fn display(&self) -> &Display {
        &self.display
    }

    /// The picture as displayed: sRGB-encoded, row-major.
    pub fn shown(&self) -> Vec<Rgb> {
        self.image.pixels.iter().map(|&p| self.display.encode(p)).collect()
    }

    /// Judges all tiles, in their order, each in its picture. A picture of less than one sample per pixel is judged as if
    /// it had one; needs are then in multiples of what it has. [`SnapshotPair::notice`] says what speaks against
    /// the pictures.
    ///
    /// Where the pictures are linear, what only one of them has met tells how much light both are likely to lack; a tile where
    /// that would be seen is not converged ([`Verdict::open_for`]).
    ///
    /// # Errors
    /// [`StillError`] if there is nothing to judge by, the model is for tiles of another size, or it cannot tell what this
    /// audience sees.
    pub fn judge(
        &self,
        oracle: &Oracle,
        grid: TileGrid,
        audience: Audience,
    ) -> Result<JudgedTiles, StillError> {
        let described = self.describe(oracle, grid)?;
        let film = self.film(grid);
        let unmet = film.as_ref().map(|film| (film, Unmet::of(film, &self.display, self.viewing)));
        let light = |tile: Tile| -> Result<Option<([TilePlanes; 2], OpenFor)>, StillError> {
            let Some((film, unmet)) = &unmet else { return Ok(None) };
            let Some(shown) = unmet.shown(film, &self.display, tile) else { return Ok(None) };
            Ok(Some(([self.planes(tile)?, shown], unmet.kind(film, tile))))
        };
        let judged = oracle.judge_finished(described, audience, light)?;
        let Judged { verdicts, described } = judged.ok_or(StillError::Audience)?;
        let verdicts = verdicts.into_iter().map(|(verdict, _)| verdict).collect();
        let described = described.into_iter().flatten().collect();
        Ok(JudgedTiles { verdicts, described, grid, audience })
    }

    /// A film of two pictures of linear light that share no samples; `None` if these are none.
    pub fn film(&self, grid: TileGrid) -> Option<Film> {
        let halves = match &self.basis {
            _ if self.image.display_referred => return None,
            Basis::Reference | Basis::Other(Samples::Nested) => return None,
            Basis::Other(Samples::Independent) => [self.image, &self.pair[1]],
            Basis::Rest(rest) => [self.image, rest],
            Basis::Halves([a, b]) => [&**a, &**b],
        };
        Some(film_of(halves, grid))
    }

    /// What a tile is judged by.
    ///
    /// # Errors
    /// [`StillError::Nested`] if nested pictures have as many samples, [`StillError::Tile`] if the tile does not
    /// lie in them.
    #[doc(hidden)]
    pub fn planes(&self, tile: Tile) -> Result<TilePlanes, StillError> {
        Ok(TilePlanes { viewing: self.viewing, ..self.gather(tile)? })
    }

    fn gather(&self, tile: Tile) -> Result<TilePlanes, StillError> {
        let (image, size, display) = (self.image, self.image.size, &self.display);
        let within = |at: usize, edge: usize, side: usize| edge > 0 && at < side && edge <= side - at;
        if !(within(tile.x, tile.width, size.0) && within(tile.y, tile.height, size.1)) {
            return Err(StillError::Tile { tile, size });
        }
        let beside = |other: &Still, samples| {
            let pair = (image.rendering(), other.rendering());
            TilePlanes::from_pair(size, tile, display, pair, samples).ok_or(StillError::Nested(image.spp))
        };
        let [_, other] = &self.pair;
        match &self.basis {
            Basis::Other(samples) => beside(other, *samples),
            Basis::Rest(rest) => beside(rest, Samples::Independent),
            Basis::Halves(halves) => {
                let halves = halves.each_ref().map(|half| half.rendering());
                Ok(TilePlanes::from_both(size, tile, display, halves))
            }
            Basis::Reference => {
                let at = |x: usize, y: usize| y * size.0 + x;
                let planes = TilePlanes::gather(size, tile, |x, y| {
                    let [a, b] = [image, &**other].map(|still| display.encode(still.pixels[at(x, y)]));
                    middle_and_difference(a, b, 1.0)
                });
                Ok(TilePlanes { rounding: image.rounding + other.rounding, ..planes })
            }
        }
    }

    /// Describes all tiles, in their order, for [`Oracle::judge_described`]. Of a picture of less than one
    /// sample per pixel they are described as if it had one; needs are then in multiples of what it has.
    ///
    /// # Errors
    /// [`StillError`] if there is nothing to judge by, or the model is for tiles of another size.
    #[doc(hidden)]
    pub fn describe(&self, oracle: &Oracle, grid: TileGrid) -> Result<Vec<Described>, StillError> {
        let tiles: Vec<Tile> = grid.tiles().collect();
        let describe = |&tile: &Tile| Ok(oracle.describe(&self.planes(tile)?, self.image.spp.max(1.0))?);
        tiles.par_iter().map(describe).collect()
    }
}

/// Verdicts on the tiles of a picture.
#[derive(Clone, Debug)]
pub struct JudgedTiles {
    verdicts: Vec<Verdict>,
    described: Vec<Described>,
    grid: TileGrid,
    audience: Audience,
}

impl JudgedTiles {
    /// One for each tile, in their order.
    pub fn verdicts(&self) -> &[Verdict] {
        &self.verdicts
    }

    /// How visible the noise is at each pixel of the picture, row-major, as a multiple of what the audience just does not see.
    /// `None` if the model of this oracle, which has judged, does not tell noise from picture.
    pub fn visible_noise(&self, oracle: &Oracle) -> Option<Vec<f32>> {
        oracle.map_visible_noise(self.grid, &self.described, self.audience)
    }
}

/// A film that has two pictures as its halves.
pub(crate) fn film_of(halves: [&Still; 2], grid: TileGrid) -> Film {
    let mut film = Film::new(grid);
    let tiles: Vec<Tile> = grid.tiles().collect();
    for half in halves {
        let spp = half.spp.round().max(1.0) as u64;
        film.add_tiles(spp, &tiles, |tile| TilePixels::in_image(tile, &half.pixels, grid.width()));
    }
    film
}

/// What the samples make that `more` has and `fewer` has not, which `more` contains.
fn rest(more: &Still, fewer: &Still) -> Still {
    let spp = more.spp - fewer.spp;
    let (of_more, of_fewer) = (more.spp / spp, fewer.spp / spp);
    let channel = |a: f32, b: f32| {
        let value = f64::from(a) * of_more - f64::from(b) * of_fewer;
        value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
    };
    let pixel = |(a, b): (&Rgb, &Rgb)| std::array::from_fn(|c| channel(a[c], b[c]));
    let pixels = more.pixels.iter().zip(&fewer.pixels).map(pixel).collect();
    Still { pixels, spp, origin: None, ..more.clone() }
}

/// The exposure of the converged picture, from both renderings of it: the same, whichever is judged.
fn settle(tone: &ToneMapping, image: &Still, other: &Still, samples: Samples) -> Display {
    let (fewer, more) = if image.spp <= other.spp { (image, other) } else { (other, image) };
    let pixel = |x: usize, y: usize| {
        let [a, b] = [fewer, more].map(|still| still.pixels[y * image.size.0 + x]);
        match samples {
            Samples::Independent => exposure::of_halves([(a, fewer.spp), (b, more.spp)]),
            Samples::Nested => {
                let [a, b] = [a, b].map(luminance);
                let scale = residual_scale(more.spp, fewer.spp, samples);
                Some(NoisyPixel { luminance: b, deviation: scale.map(|scale| (b - a).abs() * scale) })
            }
        }
    };
    tone.settle_by(|| exposure::estimate(image.size, pixel)).display
}

/// The same from one of them alone: what differs among 2×2 pixels counts as noise.
fn settle_noisy(tone: &ToneMapping, image: &Still) -> Display {
    let luminance = |x: usize, y: usize| luminance(image.pixels[y * image.size.0 + x]);
    let pixel = |x, y| Some(NoisyPixel { luminance: luminance(x, y), deviation: None });
    tone.settle_by(|| exposure::estimate(image.size, pixel)).display
}

/// Whether the pictures share samples, as far as their origins say or they show it: never a guess. Beside
/// pictures that do, those that do not are left out.
fn recognise<'a>(
    image: &Still,
    others: &[&'a Still],
    display: &Display,
) -> Result<(Samples, Vec<&'a Still>), StillError> {
    let mut nested = Vec::new();
    for other in others {
        let told = match image.relation(other) {
            OriginRelation::Known(samples) => Some(samples),
            OriginRelation::Dependent => return Err(image.dependent()),
            OriginRelation::Unknown => {
                shared_samples(image.size, image.rendering(), other.rendering(), display)
            }
        };
        match told {
            Some(Samples::Nested) => nested.push(*other),
            Some(Samples::Independent) => {}
            None => return Err(StillError::Undecided { image: image.spp, other: other.spp }),
        }
    }
    if nested.is_empty() {
        Ok((Samples::Independent, others.to_vec()))
    } else {
        Ok((Samples::Nested, nested))
    }
}

/// Checks that no two of the pictures that are going to be pooled have samples in common, as far as it is
/// known.
fn check_apart(others: &[&Still]) -> Result<(), StillError> {
    for (at, one) in others.iter().enumerate() {
        for other in &others[..at] {
            let known = one.relation(other);
            let related =
                known == OriginRelation::Known(Samples::Nested) || known == OriginRelation::Dependent;
            if related || one.pixels == other.pixels {
                return Err(StillError::Twice([other.spp, one.spp]));
            }
        }
    }
    Ok(())
}

/// Independent renderings make one of all their samples. Of nested ones, the one that differs most in its
/// samples says most.
fn pool<'a>(others: &[&'a Still], image_spp: f64, samples: Samples) -> Option<Cow<'a, Still>> {
    let distance = |r: &Still| (1.0 / r.spp - 1.0 / image_spp).abs();
    let (first, rest) = others.split_first()?;
    if samples == Samples::Nested {
        return others.iter().max_by(|a, b| distance(a).total_cmp(&distance(b))).map(|&o| Cow::Borrowed(o));
    }
    let mut all = Cow::Borrowed(*first);
    for one in rest {
        let all = all.to_mut();
        let weight = (one.spp / (all.spp + one.spp)) as f32;
        for (a, b) in all.pixels.iter_mut().flatten().zip(one.pixels.iter().flatten()) {
            let mean = *a + (b - *a) * weight;
            // The difference of two huge values may be none
            *a = if mean.is_finite() { mean } else { *a * (1.0 - weight) + b * weight };
        }
        all.rounding = all.rounding * (1.0 - weight).powi(2) + one.rounding * weight * weight;
        all.spp += one.spp;
    }
    Some(all)
}

#[cfg(test)]
mod tests;
