//! Notices when a session is fed wrongly: running means in place of new samples, one seed for every batch,
//! pictures that were encoded for a screen, tiles that were mixed up, light that cannot be.
//!
//! A [`Session`](crate::Session) watches every push. What is certain is a [`Fault`], an error of the push or
//! of the next verdicts, so that no tile says "converged" on the strength of it. What is likely is a
//! [`Warning`], once, with the number it rests on ([`Session::warnings`](crate::Session::warnings)). Samples are
//! added as they come. While a doubt is open that decides whether noise is what it seems, verdicts wait for more
//! samples; where none is, they are those of a session that does not watch.
//!
//! # What is watched
//! One pixel in each square of 8×8 pixels and its two neighbours, in small pictures one in 4×4, and four
//! times as many in the first four batches: what is farther apart than a pixel filter reaches counts as
//! independent. Four successive batches a, b, c, d of a tile make a *group*. Their differences are weighted
//! by how bright a pixel is, much as a screen shows them: else a dozen pixels at the edge of a lamp would
//! decide.
//!
//! | watched | from | says |
//! |---|---|---|
//! | each batch against the first, and its digest against those of 128 others, where batches differ | three batches | [`Fault::Repeated`] |
//! | the same while a rough tile's are all equal and of one size: no noise, or one seed | two batches | no tile stops; [`Warning::Repeated`] after three |
//! | correlation of a − c with b − d | a group | [`Fault::Shared`], [`Warning::Shared`], [`Warning::Anticorrelated`] |
//! | the same, while (c − d)² is smaller than (a − b)² | a group | [`Fault::Running`] |
//! | the same, but only with what all pixels of a tile have in common | a group | [`Warning::Changing`] |
//! | correlation of a − b with a + b − 2c: is a noisier than b? | a group | [`Warning::Noise`] |
//! | the same with the neighbours in place of c | two batches | [`Warning::Noise`], and no tile stops before a group says that it is no running mean |
//! | energy of a − b against that of c − d, of the larger batches relative to their numbers of samples | a group | [`Warning::Counts`] |
//! | all pixels of a batch against the picture before, made of smaller batches: is it brighter? | a batch | [`Warning::Encoded`], and no tile stops |
//! | steps across the borders of tiles, beside those if tiles lay otherwise | a batch of each tile | [`Warning::MixedUp`] |
//! | correlation of a − b with itself one pixel beside | two batches | [`Warning::Neighbours`] |
//! | values that are k/255, or the sRGB decoding of one, and have noise | two batches | [`Fault::Quantised`] |
//! | noise that ends at exactly 1 | two batches | [`Warning::Clipped`] |
//! | one value everywhere | two batches | [`Warning::Constant`] |
//! | infinities, NaN, light below 0 | a batch | [`Fault::Light`] |
//! | pixels of the picture that are below 0 | a verdict | [`Warning::Negative`] |
//!
//! # How often chance alone says so
//! If samples are independent and a and c have equal sizes, exchanging a pixel's a and c leaves everything
//! as likely and changes the sign of its term t = ±√|(a − c)(b − d)|. Given all |t| the signs are fair coins,
//! and z = Σt/√Σt² exceeds 6.5 with p < exp(−6.5²/2) = 7·10⁻¹⁰, however the noise is distributed (Hoeffding
//! 1963); the root keeps a few fireflies from hiding the rest. Weights change nothing about it: they depend
//! on the mean of all four. So it is for the other correlations. Sums are looked at once before each round of
//! verdicts, over all groups so far and over the new ones alone: in 10,000 rounds, and with three
//! correlations of two signs, by chance with p < 10⁻⁴. Three things are not exact and were measured instead
//! (`tests/tests/it/watch.rs`): sizes may differ by a factor of 2. The z of batches has to be as large, and
//! of the same sign, without what the noise of a tile has in common with its picture, since a Markov chain's
//! brightness wanders as a whole. And z is divided by √R, where R is how much more energy the noise of four
//! watched pixels in a row has in sum than in each. A source that says that its pixels share samples
//! ([`PixelNoise::Shared`](crate::source::PixelNoise)) gives one term a tile. Of one whose samples complete each other
//! ([`SourceInfo::stratified`](crate::SourceInfo)), what rests on noise that falls as 1/n is left out, and without
//! halves, where all batches are of one sequence, what rests on independent batches. Certain is only what has, in
//! addition, a correlation Σt/Σ|t| of at least a fifth; running means have 0.4 and more.
//!
//! # What is not noticed
//! Faults in fewer than four batches of a tile, but for repeated ones. What all batches have in common: a part of
//! their samples from one seed, of batches of one size, is as a texture of the picture is. Running means whose seeds
//! repeat otherwise than from the first batch on. Pictures encoded for a screen in
//! floating point, or sums, in batches of one size whose noise does not reach white: equal batches of them
//! are as independent as any. Counts
//! that are all wrong by one factor, or that grow with batches of few samples, where a few fireflies make
//! all noise energy. Tiles that were mixed up where the picture hardly varies along their borders beside its
//! noise, and a whole picture that is upside down.

mod borders;
mod correlation;
mod group;
mod light;
mod points;
mod repeats;
mod said;
mod shift;
mod values;

pub use borders::MixUp;
pub use light::ImpossibleLight;
#[doc(hidden)]
pub use light::LightCheck;
pub(crate) use light::check_picture;
pub use said::{Encoding, Fault, Precision, Warning};
pub(crate) use values::PictureValues;

use crate::criterion::Verdict;
use crate::display::luminance;
use crate::film::Film;
use crate::source::PixelNoise;
use crate::tile::{Tile, TileGrid, TilePixels};
use correlation::{Energies, Sums};
use group::TileWatch;
use light::SeenLight;
use points::Points;
use rayon::prelude::*;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use shift::Shift;
use values::Values;

/// Groups of a tile of which each is watched; then every fourth.
const DENSE: u64 = 4;

#[derive(Clone, Debug)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(crate) struct Watch {
    grid: TileGrid,
    /// Pixels share samples, as their source says.
    shared: bool,
    /// Samples complete each other, as their source says: those of one sequence, or of two.
    #[cfg_attr(feature = "files", serde(skip))]
    sequences: Option<u32>,
    tiles: Vec<TileWatch>,
    /// Of all groups, and of those between the last two looks.
    sums: [Sums; 2],
    /// Samples from which it is worth to look at the whole picture again.
    picture_at: u64,
    warnings: Vec<Warning>,
    /// Whether running means were pushed.
    running: bool,
    /// Whether a tile got batches of several sizes.
    sizes_vary: bool,
    /// Values are linear radiance, as whoever pushes them says.
    linear: bool,
}

impl Watch {
    pub(crate) fn new(grid: TileGrid) -> Self {
        Self {
            grid,
            shared: false,
            sequences: None,
            tiles: vec![TileWatch::default(); grid.len()],
            sums: [Sums::default(); 2],
            picture_at: 0,
            warnings: Vec::new(),
            running: false,
            sizes_vary: false,
            linear: false,
        }
    }

    pub(crate) fn set_linear(&mut self) {
        self.linear = true;
    }

    pub(crate) fn set_sequences(&mut self, sequences: Option<u32>) {
        self.sequences = sequences;
    }

    pub(crate) fn set_pixels(&mut self, pixels: PixelNoise) {
        self.shared = pixels == PixelNoise::Shared;
    }

    pub(crate) fn pixels(&self) -> PixelNoise {
        if self.shared { PixelNoise::Shared } else { PixelNoise::Independent }
    }

    pub(crate) fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Goes on with what a checkpoint holds, which has to be of a picture like this one; false if it is not.
    /// Pixels share samples if either says so.
    #[cfg(feature = "files")]
    pub(crate) fn restore(&mut self, kept: Self) -> bool {
        let points = self.points();
        let fits = |(tile, watch): (Tile, &TileWatch)| {
            watch.repeats.fits(tile, watch.batches)
                && watch.fits(points.at_first(tile).count(), points.of(tile).count())
        };
        let fits = kept.grid == self.grid
            && kept.tiles.len() == self.grid.len()
            && self.grid.tiles().zip(&kept.tiles).all(fits);
        if fits {
            let (shared, linear) = (self.shared || kept.shared, self.linear || kept.linear);
            *self = Self { shared, linear, sequences: self.sequences, ..kept };
        }
        fits
    }

    fn points(&self) -> Points {
        Points::new(self.grid)
    }

    /// What is to be seen of a batch by itself, of those pixels that are watched.
    pub(crate) fn glance(&self, tile: Tile, mean: TilePixels<'_>) -> SeenLight {
        SeenLight::of(self.points().of(tile).map(|(x, y)| mean.row(y)[x]))
    }

    /// Whether a batch that fits its tile can be light at all, together with what the film has of the tile, after such a
    /// glance at it. It hangs on nothing else: neither on other tiles nor on batches that were refused.
    pub(crate) fn check_light(
        &self,
        film: &Film,
        tile: Tile,
        spp: u64,
        mean: TilePixels<'_>,
        glance: SeenLight,
    ) -> Result<(), Fault> {
        // The watched pixels first, and all only if those look wrong or there are none
        let whole = || light::check(mean.iter());
        let checked = match glance.by_itself() {
            Ok(()) if !glance.is_of_nothing() => return Ok(()),
            Err(ImpossibleLight::NotFinite { .. }) => whole(),
            _ => whole().or_else(|light| {
                // New samples may be differences of stored pictures: all that there are have to be light together
                let had = film.spp(tile.index) as f64;
                let (old, new) = (had / (had + spp as f64), spp as f64 / (had + spp as f64));
                let pixels = tile.rows(self.grid.width()).flatten().zip(mean.iter());
                let all = pixels.map(|(pixel, new_mean)| {
                    let before = film.pixel(tile.index, pixel);
                    std::array::from_fn(|c| {
                        (f64::from(before[c]) * old + f64::from(new_mean[c]) * new) as f32
                    })
                });
                if had > 0.0 { light::check(all) } else { Err(light) }
            }),
        };
        checked.map_err(|light| Fault::Light { tile: tile.index, light })
    }

    /// Whether samples that came after their tile had stopped are of the same light. Of n samples with mean l, independent of
    /// halves a and b, E(a − l)(b − l) = σ²/n is as much of E(a − b)² as their numbers say; a lamp that went on adds to it
    /// in all pixels, and a firefly in one.
    pub(crate) fn is_like(&self, film: &Film, tile: Tile, spp: u64, late: TilePixels<'_>) -> bool {
        let mut energies = Energies::default();
        for (pixel, late) in tile.rows(self.grid.width()).flatten().zip(late.iter()) {
            let [(a, of_a), (b, of_b)] = film.pixel_halves(tile.index, pixel);
            let [a, b, late] = [a, b, late].map(|pixel| f64::from(luminance(pixel)));
            let rounding = f64::from(repeats::ROUNDING) * a.abs();
            if of_a > 0 && of_b > 0 && late.is_finite() && (a - late).abs() > rounding {
                let times = 1.0 / (spp as f64 * (1.0 / of_a as f64 + 1.0 / of_b as f64));
                energies.see(times * (a - b).powi(2), (a - late) * (b - late));
            }
        }
        let light = self.check_light(film, tile, spp, late, self.glance(tile, late));
        light.is_ok() && energies.excess(1.0).is_none()
    }

    /// What a batch says beside the picture that it is going to be added to.
    pub(crate) fn compare(&self, film: &Film, tile: Tile, spp: u64, mean: TilePixels<'_>) -> Option<Shift> {
        if self.shared { None } else { Shift::of(film, tile, self.tiles[tile.index].batches, spp, mean) }
    }

    /// Takes notice of batches that were added, of tiles in the order of the grid, of what they said before, and of the
    /// numbers that the caller gave: of running means, those are not the batches', and have `growth` times their samples.
    pub(crate) fn see<'a, 'b>(
        &mut self,
        seen: Vec<(Tile, Option<Shift>)>,
        (spp, growth): (u64, f64),
        pixels: impl Fn(Tile) -> TilePixels<'a> + Sync,
        given: impl Fn(Tile) -> TilePixels<'b> + Sync,
    ) {
        self.running |= growth > 0.0;
        self.sizes_vary |= seen.iter().any(|(tile, _)| !self.tiles[tile.index].repeats.is_size(spp));
        let (points, shared) = (self.points(), self.shared);
        let mut seen = seen.into_iter().peekable();
        let watched = self.tiles.iter_mut().enumerate();
        let watched: Vec<(&mut TileWatch, (Tile, Option<Shift>))> = watched
            .filter_map(|(i, watch)| seen.next_if(|(tile, _)| tile.index == i).map(|of_it| (watch, of_it)))
            .collect();
        watched.into_par_iter().for_each(|(watch, (tile, shift))| {
            let batch = [pixels(tile), given(tile)];
            let total = if growth > 0.0 { (growth * spp as f64).round() as u64 } else { spp };
            watch.sums.shift.add(&shift.unwrap_or_default());
            watch.repeats.see(tile, watch.batches, spp, batch, growth as f32);
            Self::see_tile(watch, (points, shared), tile, (spp, total), batch);
        });
    }

    fn see_tile(
        watch: &mut TileWatch,
        (points, shared): (Points, bool),
        tile: Tile,
        (spp, total): (u64, u64),
        [mean, given]: [TilePixels<'_>; 2],
    ) {
        let batch = watch.batches;
        watch.batches += 1;
        let group = batch / 4;
        if group >= DENSE && !group.is_multiple_of(4) {
            return;
        }
        let light = |place| points::light(mean, place);
        if group == 0 {
            points.of(tile).for_each(|(x, y)| watch.values.see(given.row(y)[x], total));
            watch.see(spp, points.at_first(tile).map(light).collect());
        } else {
            watch.see(spp, points.of(tile).map(light).collect());
        }
        if let Some(found) = watch.compare(shared) {
            watch.sums.add(&found);
        }
    }

    /// Adds up what tiles have found since the last look, in their order: a sum of floating-point numbers depends on
    /// it, and the order in which tiles are sampled is nobody's business.
    fn gather(&mut self) -> Values {
        self.sums[1] = Sums::default();
        let mut values = Values::default();
        for tile in &mut self.tiles {
            let found = std::mem::take(&mut tile.sums);
            let found = self.sequences.map_or(found, |number| found.of_points(number == 1));
            self.sums.iter_mut().for_each(|sums| sums.add(&found));
            values.add(&tile.values);
        }
        values
    }

    /// Looks at all that was seen, before a verdict.
    pub(crate) fn look(&mut self, film: &Film) -> Result<(), Fault> {
        let values = self.gather();
        let repeats = self.check_repeats()?;
        let rounded = self.check_precision(&values, film)?;
        for sums in self.sums {
            sums.fault()?;
        }
        let found = self.sums.iter().flat_map(|sums| sums.warnings(self.shared));
        let found = found.chain(self.sums[0].doubt().map(Warning::Noise));
        let found = found.chain(self.sums[0].may_be_totals().map(Warning::Totals));
        let samples = film.total_samples();
        let grown = samples >= self.picture_at;
        let mixed_up = if grown { borders::mix_up(film) } else { None };
        let negative = if grown && !self.shared { light::negative(film) } else { None };
        if grown {
            self.picture_at = samples + samples / 2;
        }
        let found = found.chain(mixed_up.map(Warning::MixedUp)).chain(negative.map(Warning::Negative));
        let behind = if self.running { self.sums[0].behind() } else { None };
        let found = found.chain(behind.map(Warning::Behind));
        let clipped = self.sums[0].ends.clipped(&values).filter(|_| !self.linear).map(Warning::Clipped);
        let constant = self.tiles.iter().all(|tile| tile.repeats.first_again).then(|| film.pixel(0, 0));
        let constant = constant.filter(|&colour| film.is_all(colour)).map(Warning::Constant);
        let unsaid = self.is_unsaid().then_some(Warning::Unsaid).filter(|_| clipped.is_none());
        let found: Vec<Warning> =
            found.chain(clipped).chain(constant).chain(repeats).chain(rounded).chain(unsaid).collect();
        found.into_iter().for_each(|warning| self.warn(warning));
        Ok(())
    }

    /// Takes a warning down, unless one of its kind is there.
    pub(crate) fn warn(&mut self, warning: Warning) {
        let kind = std::mem::discriminant(&warning);
        if !self.warnings.iter().any(|known| std::mem::discriminant(known) == kind) {
            self.warnings.push(warning);
        }
    }

    /// Takes notice of what verdicts say of the picture that is shown: where denoisers take a rare sample for a firefly, a
    /// few tiles become darker, and not most.
    pub(crate) fn see_verdicts(&mut self, verdicts: &[Verdict]) {
        let (of, tiles) =
            (verdicts.len(), verdicts.iter().filter(|verdict| verdict.brightness_differs).count());
        if 2 * tiles > of {
            self.warn(Warning::Brightness { tiles, of });
        }
    }

    /// Whether values may be encoded for a screen or not, and nobody has said.
    fn is_unsaid(&self) -> bool {
        !(self.linear || self.sizes_vary)
            && self.tiles.iter().any(|tile| tile.batches >= 4 && tile.repeats.varies())
    }

    /// Whether nothing may stop till more batches have come: the first two look like running means, and four do not
    /// say otherwise; batches have more and more samples, as totals have, and four have not come yet, or look like
    /// them; larger ones are brighter; all are one picture of one size, which may have noise; or running means are of so few bits that they are
    /// going to end.
    pub(crate) fn doubts(&self) -> bool {
        self.looks_wrong()
            || self.tiles.iter().any(|tile| tile.grows && tile.batches < 4)
            || self.alike().is_some()
    }

    /// Whether that is for what batches are, and not since too few have come to tell: then no tile converges at its limit.
    pub(crate) fn looks_wrong(&self) -> bool {
        let sums = &self.sums[0];
        sums.doubt().is_some()
            || sums.may_be_totals().is_some()
            || sums.encoded().is_some()
            || (self.running && self.warnings.iter().any(|warning| matches!(warning, Warning::Rounded(_))))
    }

    /// The number of samples of each batch of a tile that may have noise or not, as all were the same picture.
    pub(crate) fn only_size(&self, tile: usize) -> Option<u64> {
        self.tiles[tile].repeats.only_size()
    }

    /// Tiles of which all batches are the same picture, if those are most that look noisy, and none tells whether there
    /// is noise.
    fn alike(&self) -> Option<(usize, usize)> {
        let of = self.tiles.iter().filter(|tile| tile.repeats.rough).count();
        let tiles = self.tiles.iter().filter(|tile| tile.repeats.is_one_picture()).count();
        (2 * tiles > of && !self.tiles.iter().any(|tile| tile.repeats.is_told())).then_some((tiles, of))
    }

    /// Whether a tile's noise came twice. Pixels that were never seen to change may have none.
    fn check_repeats(&self) -> Result<Option<Warning>, Fault> {
        let of_all =
            |which: &dyn Fn(&TileWatch) -> bool| self.tiles.iter().filter(|tile| which(tile)).count();
        let tiles = of_all(&|tile| tile.repeats.are_certain(self.shared));
        if tiles > 0 {
            return Err(Fault::Repeated { tiles, of: of_all(&|tile| tile.repeats.varies()) });
        }
        // Two of the first three batches that a session asks for have different sizes
        let told = self.tiles.iter().filter(|tile| tile.repeats.rough).all(|tile| tile.batches > 2);
        Ok(self.alike().filter(|_| told).map(|(tiles, of)| Warning::Repeated { tiles, of }))
    }

    /// Whether all values are of fewer bits than those of 32-bit floats.
    fn check_precision(&self, values: &Values, film: &Film) -> Result<Option<Warning>, Fault> {
        // A picture without noise may be of 8-bit numbers: an unlit texture is. Noise of them is an 8-bit picture's
        if !self.tiles.iter().any(|tile| tile.repeats.varies()) {
            return Ok(None);
        }
        if let Some(encoding) = values.quantised() {
            return Err(Fault::Quantised { encoding });
        }
        let Some(precision) = values.precision() else { return Ok(None) };
        let most = self.grid.tiles().map(|tile| film.spp(tile.index)).max().unwrap_or(0);
        let ends = match precision {
            Precision::Integers { bits, whole } => whole || bits < 16,
            // A sample changes a mean of n by 1/n of what it differs by: by less than four steps
            Precision::Floats { bits } => self.running && most >> bits.saturating_sub(2) > 0,
        };
        if ends { Err(Fault::Rounded(precision)) } else { Ok(Some(Warning::Rounded(precision))) }
    }
}

#[cfg(test)]
impl Watch {
    /// Loses a watched pixel.
    pub(crate) fn corrupt(&mut self) {
        self.tiles[0].corrupt();
    }
}

#[cfg(test)]
mod tests;
