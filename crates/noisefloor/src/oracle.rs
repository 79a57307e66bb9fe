//! The oracle: a trained model as a stopping criterion.

use crate::container;
use crate::criterion::{CriterionError, Needs, StoppingCriterion, Verdict, View};
use crate::descriptor::{Described, DescriptorError};
use crate::evidence::{Evidence, TilePlanes};
use crate::model::Model;
use crate::params::Audience;
use crate::tile::{Tile, TileGrid};
use rayon::prelude::*;
use thiserror::Error;

/// P at which two pictures count as identical (Takouachet et al. 2017, §4.4).
pub const DEFAULT_THRESHOLD: f32 = 0.9;

/// A tile of which more than one in so many pixels has no valid sample is not called converged: it gives no evidence.
const NO_EVIDENCE: usize = 16;

/// A probability threshold outside (0, 1).
#[derive(Debug, Error, Clone, Copy, PartialEq)]
#[error("the probability threshold must lie between 0 and 1, not {0}")]
pub struct ThresholdError(pub f32);

/// Judges tiles by a trained model.
#[derive(Clone, Debug)]
pub struct Oracle {
    model: Model,
    threshold: f32,
    /// What tiles of the picture were like when last described, for the picture's numbers; of tiles by index.
    described: Vec<Option<Described>>,
}

impl Oracle {
    /// An oracle that calls a tile converged where P ≥ `threshold`.
    ///
    /// # Errors
    /// [`ThresholdError`] unless 0 < `threshold` < 1.
    pub fn new(model: Model, threshold: f32) -> Result<Self, ThresholdError> {
        if threshold > 0.0 && threshold < 1.0 {
            Ok(Self { model, threshold, described: Vec::new() })
        } else {
            Err(ThresholdError(threshold))
        }
    }

    /// The bundled model at P ≥ 0.9.
    #[cfg(feature = "bundled-model")]
    pub fn bundled() -> Self {
        Self { model: Model::bundled(), threshold: DEFAULT_THRESHOLD, described: Vec::new() }
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// P from which a tile counts as converged.
    pub fn threshold(&self) -> f32 {
        self.threshold
    }

    /// Describes one tile of a picture by its planes, which have `samples` samples per pixel, above 0. [`Oracle::judge_described`]
    /// wants all tiles of the picture.
    ///
    /// # Errors
    /// [`CriterionError::TileSize`] if the model is for tiles of another size.
    pub fn describe(&self, planes: &TilePlanes, samples: f64) -> Result<Described, CriterionError> {
        self.model.descriptor.describe(planes, samples).map_err(|e| self.misfit(e))
    }

    /// Judges the tiles that make up a picture, or as many as there are of it: people see a tile in its picture, and so does
    /// the model. One verdict a tile.
    pub fn judge_described(&self, tiles: &[Described]) -> Vec<Verdict> {
        let numbers = self.model.descriptor.in_picture(tiles);
        tiles.iter().zip(numbers).map(|(tile, raw)| self.verdict(&raw, tile.samples.round() as u64)).collect()
    }

    /// Judges tiles as [`Oracle::judge_described`] does, for other eyes than those of the training data: P is the share of *them*, who see of
    /// n samples what trained observers see of [`Audience::seen_as`] n. `None` if that cannot be told, since the descriptor does not tell noise from
    /// picture, and the audience is not [`Audience::TRAINED`].
    pub fn judge_described_for(&self, tiles: &[Described], audience: Audience) -> Option<Vec<Verdict>> {
        if audience == Audience::TRAINED {
            return Some(self.judge_described(tiles));
        }
        let numbers = self.model.descriptor.in_picture(tiles);
        tiles.iter().zip(numbers).map(|(tile, raw)| self.verdict_for(raw, tile.samples, audience)).collect()
    }

    fn verdict_for(&self, mut raw: Vec<f32>, samples: f64, audience: Audience) -> Option<Verdict> {
        let seen_as = audience.seen_as(samples);
        // Someone who is never satisfied with so few: the need of the trained is found from a sample on.
        let from = seen_as.max(1.0).min(samples);
        if !self.model.descriptor.project(&mut raw, (from / samples) as f32) {
            return None;
        }
        let trained = self.verdict(&raw, from.round().max(1.0) as u64);
        let satisfied = seen_as > 0.0;
        let converged = satisfied && trained.converged;
        let expected_samples = if converged {
            Some(samples.round() as u64)
        } else {
            trained.expected_samples.map(|needed| audience.samples(needed))
        };
        let probability = if satisfied { trained.probability } else { Some(0.0) };
        Some(Verdict { converged, probability, expected_samples, unfamiliar: trained.unfamiliar })
    }

    /// A verdict by a whole, raw descriptor.
    fn verdict(&self, raw: &[f32], samples: u64) -> Verdict {
        let unfamiliar = !self.model.is_familiar(raw);
        let mut scaled = raw.to_vec();
        let probability = self.model.probability(&mut scaled);
        let converged = probability >= self.threshold;
        let expected_samples = if converged { Some(samples) } else { self.expect(raw, &mut scaled, samples) };
        Verdict { converged, probability: Some(probability), expected_samples, unfamiliar }
    }

    /// The visible noise (see [`crate::Descriptor::visible_noise`]) from which it is seen: of an even noise in a tile of the mean
    /// texture of the training data, where P crosses the threshold. `None` if the descriptor does not tell noise from picture.
    pub fn just_visible(&self) -> Option<f32> {
        let Model { descriptor, scaler, .. } = &self.model;
        let at = |doublings: f32| {
            let mut raw = scaler.mean.clone();
            descriptor.project(&mut raw, doublings.exp2());
            raw
        };
        let (mut noisy, mut clean) = (-20.0f32, 20.0f32);
        while clean - noisy > 0.01 {
            let middle = 0.5 * (noisy + clean);
            let seen = self.model.probability(&mut at(middle)) < self.threshold;
            if seen { noisy = middle } else { clean = middle }
        }
        descriptor.pooled_visible_noise(&at(clean))
    }

    /// The visible noise of a whole image (see [`crate::Descriptor::visible_noise`]), row-major, from the planes of its tiles; NaN
    /// where `planes` has none. `None` if the descriptor does not tell noise from picture.
    ///
    /// # Errors
    /// Those of `planes`.
    pub fn map_visible_noise<E: Send>(
        &self,
        grid: TileGrid,
        planes: impl Fn(Tile) -> Result<Option<TilePlanes>, E> + Sync,
    ) -> Result<Option<Vec<f32>>, E> {
        let tiles: Vec<Tile> = grid.tiles().collect();
        let map_of = |&tile: &Tile| {
            Ok(planes(tile)?.map(|planes| {
                let map = self.model.descriptor.visible_noise(&planes);
                planes.recycle();
                map
            }))
        };
        let maps: Vec<_> = tiles.par_iter().map(map_of).collect::<Result<_, _>>()?;
        let mut image = vec![f32::NAN; grid.width() * grid.height()];
        for (tile, map) in tiles.iter().zip(maps) {
            match map {
                Some(Some(map)) => {
                    let pixels = tile.rows(grid.width()).flatten();
                    pixels.zip(&map).for_each(|(pixel, &value)| image[pixel] = value);
                }
                Some(None) => return Ok(None),
                None => {}
            }
        }
        Ok(Some(image))
    }

    /// What a tile is judged by; `None` if too many of its pixels have no evidence.
    fn planes(&self, view: &View<'_>, tile: Tile) -> Result<Option<TilePlanes>, CriterionError> {
        if view.film.unsampled_pixels(tile.index) > tile.pixels() / NO_EVIDENCE {
            return Ok(None);
        }
        Ok(Some(match self.model.evidence {
            Evidence::Halves => TilePlanes::from_halves(view.film, view.display, tile),
            Evidence::Reference => {
                let reference = view.reference.ok_or_else(|| CriterionError::NoReference(self.name()))?;
                TilePlanes::from_reference(view.film, view.display, reference, tile)
            }
            Evidence::Alone => TilePlanes::from_picture(view.film, view.display, tile),
        }))
    }

    fn misfit(
        &self,
        DescriptorError::TileSize { expected, width, height }: DescriptorError,
    ) -> CriterionError {
        CriterionError::TileSize { name: self.name(), expected, width, height }
    }

    /// Samples at which P crosses the threshold if nothing but the noise changes, as noise does: σ ∝ 1/√n. Found by doubling,
    /// then bisecting ln n; `None` if the descriptor does not tell noise from picture, or 2²⁰ times the samples are not enough.
    fn expect(&self, raw: &[f32], scratch: &mut [f32], samples: u64) -> Option<u64> {
        let mut satisfied = |doublings: f32| {
            scratch.copy_from_slice(raw);
            let known = self.model.descriptor.project(scratch, doublings.exp2());
            known.then(|| self.model.probability(scratch) >= self.threshold)
        };
        let mut high = 1.0;
        while !satisfied(high)? {
            high += 1.0;
            if high > 20.0 {
                return None;
            }
        }
        let mut low = high - 1.0;
        while high - low > 0.02 {
            let middle = 0.5 * (low + high);
            if satisfied(middle)? { high = middle } else { low = middle }
        }
        Some((samples as f64 * f64::from(high).exp2()).ceil() as u64)
    }
}

impl StoppingCriterion for Oracle {
    fn name(&self) -> String {
        format!("svm oracle ({})", self.model.descriptor.name())
    }

    fn needs(&self) -> Needs {
        match self.model.evidence {
            Evidence::Halves => Needs { halves: true, reference: false },
            Evidence::Reference => Needs { halves: false, reference: true },
            Evidence::Alone => Needs::default(),
        }
    }

    fn audience(&self) -> Audience {
        self.model.audience
    }

    fn visible_noise(&self, view: &View<'_>) -> Option<Vec<f32>> {
        self.map_visible_noise(view.film.grid(), |tile| self.planes(view, tile)).ok()?
    }

    /// What each tile was like when last described: tiles that have stopped count so for the picture, whatever their neighbours, whose
    /// edges were looked at too, have become.
    fn state(&self) -> Vec<u8> {
        container::payload(&self.described).unwrap_or_default()
    }

    fn restore(&mut self, grid: TileGrid, state: &[u8]) -> bool {
        let Ok(described) = container::unpack::<Vec<Option<Described>>>(state) else { return false };
        let sound = |d: &Described| {
            d.own.len() == self.model.descriptor.own_len()
                && d.own.iter().all(|v| v.is_finite())
                && [d.samples, d.area].iter().all(|v| v.is_finite() && *v > 0.0)
        };
        let fits = [0, grid.len()].contains(&described.len()) && described.iter().flatten().all(sound);
        if fits {
            self.described = described;
        }
        fits
    }

    /// Tiles that are not named count for the picture as they were when last described: they are looked at again if their
    /// samples have changed since. Use an oracle of its own for each film: one with as many tiles and samples is not told from
    /// another.
    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let grid = view.film.grid();
        // Another film than the last one, if it has other tiles or fewer samples.
        let fewer = |(tile, d): (usize, &Option<Described>)| {
            d.as_ref().is_some_and(|d| d.samples > view.film.samples(tile) as f64)
        };
        if self.described.len() != grid.len() || self.described.iter().enumerate().any(fewer) {
            self.described = vec![None; grid.len()];
        }
        let mut due = vec![false; grid.len()];
        tiles.iter().for_each(|t| due[t.index] = true);
        let this: &Self = self;
        let describe = |tile: Tile| {
            let samples = view.film.samples(tile.index) as f64;
            let known =
                this.described[tile.index].as_ref().filter(|d| d.samples == samples && !due[tile.index]);
            if known.is_some() {
                return Ok(known.cloned());
            }
            let Some(planes) = this.planes(view, tile)? else { return Ok(None) };
            let described = this.describe(&planes, samples);
            planes.recycle();
            described.map(Some)
        };
        let all: Vec<Tile> = grid.tiles().collect();
        self.described = all.into_par_iter().map(describe).collect::<Result<_, _>>()?;

        // Judge all that can be seen, and hand out what was asked for.
        let seen: Vec<Described> = self.described.iter().flatten().cloned().collect();
        let mut judged = self.model.descriptor.in_picture(&seen).into_iter();
        let numbers: Vec<Option<Vec<f32>>> =
            self.described.iter().map(|d| d.as_ref().and_then(|_| judged.next())).collect();
        let asked: Vec<Option<Vec<f32>>> = tiles.iter().map(|t| numbers[t.index].clone()).collect();
        let judge = |(tile, raw): (&Tile, Option<Vec<f32>>)| match raw {
            Some(raw) => self.verdict(&raw, view.film.samples(tile.index)),
            None => Verdict {
                converged: false,
                probability: Some(0.0),
                expected_samples: None,
                unfamiliar: false,
            },
        };
        Ok(tiles.par_iter().zip(asked).map(judge).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NoiseMask;
    use crate::descriptor::Descriptor;
    use crate::display::Display;
    use crate::film::Film;
    use crate::model::tests::small;
    use crate::source::Rgb;
    use crate::svm::{Scaler, Svm};

    /// A film of 64×64 pixels with `samples` samples of standard deviation `sigma` around grey.
    fn film(samples: u32, sigma: f32) -> Film {
        film_of(|_| 0.2, samples, sigma)
    }

    /// The same around a picture that is given by the number of the pixel.
    fn film_of(picture: fn(usize) -> f32, samples: u32, sigma: f32) -> Film {
        let mut film = Film::new(TileGrid::new(64, 64, 64).unwrap());
        let mut state = 5u64;
        let mut bell = || {
            let mut uniform = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 40) as f32 / (1 << 24) as f32
            };
            (uniform() + uniform() + uniform() + uniform() - 2.0) * 3f32.sqrt()
        };
        for _ in 0..2 {
            let half = samples / 2;
            let batch: Vec<Rgb> =
                (0..64 * 64).map(|i| [picture(i) + sigma * bell() / (half as f32).sqrt(); 3]).collect();
            film.add(0, half, &batch).unwrap();
        }
        film
    }

    fn judge(oracle: &mut Oracle, film: &Film, reference: Option<&[Rgb]>) -> Result<Verdict, CriterionError> {
        let view = View { film, display: &Display::SRGB, reference };
        Ok(oracle.judge(&view, &[film.grid().tile(0)])?[0])
    }

    #[test]
    fn the_threshold_is_checked() {
        for bad in [0.0, 1.0, -1.0, f32::NAN] {
            assert!(Oracle::new(small(), bad).is_err(), "{bad}");
        }
    }

    #[cfg(feature = "bundled-model")]
    #[test]
    fn more_samples_are_less_visible_and_the_expected_need_is_near() {
        let mut oracle = Oracle::bundled();
        let few = judge(&mut oracle, &film(100, 0.5), None).unwrap();
        let many = judge(&mut oracle, &film(100_000, 0.5), None).unwrap();
        assert!(!few.converged && many.converged, "{few:?} {many:?}");
        // At the samples that were expected, another realisation of the noise is about at the threshold.
        let expected = few.expected_samples.unwrap() as u32;
        let there = judge(&mut oracle, &film(expected, 0.5), None).unwrap().probability.unwrap();
        assert!((0.8..0.97).contains(&there), "{expected}: {there}");
        assert_eq!(many.expected_samples, Some(100_000));
    }

    #[cfg(feature = "bundled-model")]
    #[test]
    fn a_reference_is_evidence_as_good_as_halves() {
        let model = Model { evidence: Evidence::Reference, ..Model::bundled() };
        let mut oracle = Oracle::new(model, DEFAULT_THRESHOLD).unwrap();
        assert_eq!(oracle.needs(), Needs { halves: false, reference: true });
        let (noisy, grey) = (film(200, 0.5), vec![Display::SRGB.encode([0.2; 3]); 64 * 64]);
        assert!(matches!(judge(&mut oracle, &noisy, None), Err(CriterionError::NoReference(_))));
        let by_reference = judge(&mut oracle, &noisy, Some(&grey)).unwrap().probability.unwrap();
        let by_halves = judge(&mut Oracle::bundled(), &noisy, None).unwrap().probability.unwrap();
        // The converged picture is known here: both residuals have the same noise, in other realisations.
        assert!((by_reference - by_halves).abs() < 0.1, "{by_reference} {by_halves}");
    }

    #[cfg(feature = "bundled-model")]
    #[test]
    fn noise_that_is_just_visible_is_where_p_crosses() {
        let oracle = Oracle::bundled();
        let just = oracle.just_visible().unwrap();
        let descriptor = |amplitude: f32| {
            let mut raw = oracle.model().scaler.mean.clone();
            let here = oracle.model().descriptor.pooled_visible_noise(&raw).unwrap();
            oracle.model().descriptor.project(&mut raw, (here / amplitude).powi(2));
            oracle.model().probability(&mut raw)
        };
        assert!(descriptor(0.99 * just) > DEFAULT_THRESHOLD && descriptor(1.01 * just) < DEFAULT_THRESHOLD);
    }

    /// Single pixels of black and white: more contrast than any zone of the training data has.
    #[cfg(feature = "bundled-model")]
    fn checker(pixel: usize) -> f32 {
        if (pixel + pixel / 64).is_multiple_of(2) { 0.0 } else { 1.0 }
    }

    #[cfg(feature = "bundled-model")]
    #[test]
    fn what_nobody_was_asked_about_is_told_from_what_is_only_noisy_or_clean() {
        let verdict = |film: &Film| judge(&mut Oracle::bundled(), film, None).unwrap();
        // Black, next to black, and flat: nothing unheard of, and nothing to see.
        for picture in [|_| 0.0, |_| 1e-9, |_| 0.2] {
            let flat = verdict(&film_of(picture, 100, 0.0));
            assert!(!flat.unfamiliar && flat.converged, "{flat:?}");
        }
        // Noise alone, however much, is no texture: it is not converged, and is expected to be.
        for sigma in [1.0, 10.0] {
            let noisy = verdict(&film_of(|_| 0.2, 100, sigma));
            assert!(
                !noisy.unfamiliar && !noisy.converged && noisy.expected_samples > Some(1000),
                "{noisy:?}"
            );
        }
        // More contrast than any zone had: said, and done all the same when it is clean.
        let contrast = verdict(&film_of(checker, 100, 0.0));
        assert!(contrast.unfamiliar && contrast.converged, "{contrast:?}");
    }

    #[cfg(feature = "bundled-model")]
    #[test]
    fn an_unfamiliar_tile_gets_twice_the_samples() {
        let careless = Model { familiarity: None, ..Model::bundled() };
        let film = film_of(checker, 100, 2.0);
        let expected = |model: Model| {
            let verdict = judge(&mut Oracle::new(model, DEFAULT_THRESHOLD).unwrap(), &film, None).unwrap();
            assert!(!verdict.converged, "{verdict:?}");
            verdict.expected_samples.unwrap() as f64
        };
        let ratio = expected(Model::bundled()) / expected(careless);
        // The expected need is found to a fiftieth of a doubling, each time.
        assert!((ratio.log2() - 1.0).abs() < 0.04, "{ratio}");
    }

    /// People who need twice the samples see at 2n what the trained see at n, and expect twice the samples; who need no more see the same.
    #[cfg(feature = "bundled-model")]
    #[test]
    fn another_audience_sees_the_noise_of_fewer_samples() {
        let oracle = Oracle::bundled();
        let describe = |samples: u32| {
            let film = film(samples, 1.5);
            let planes = TilePlanes::from_halves(&film, &Display::SRGB, film.grid().tile(0));
            vec![oracle.describe(&planes, f64::from(samples)).unwrap()]
        };
        let at = describe(400);
        let own = oracle.judge_described(&at)[0];
        assert_eq!(oracle.judge_described_for(&at, Audience::TRAINED).unwrap()[0], own);
        let for_line =
            |slope, offset| oracle.judge_described_for(&at, Audience { slope, offset }).unwrap()[0];
        // Half the demands are no reason to stop sooner than the session would.
        assert_eq!(for_line(0.5, 0.0), own);
        let half = describe(200);
        let twice = for_line(2.0, 0.0);
        // Another film has other noise: its amplitude over 4096 pixels is known to 1 %.
        let half = oracle.judge_described(&half)[0];
        assert!((twice.probability.unwrap() - half.probability.unwrap()).abs() < 0.03, "{twice:?} {half:?}");
        let (own, twice) = (own.expected_samples.unwrap() as f64, twice.expected_samples.unwrap() as f64);
        assert!((twice / own - 2.0).abs() < 0.06, "{own} {twice}");
        let never = for_line(1.0, 1000.0);
        assert!(!never.converged && never.probability == Some(0.0) && never.expected_samples > Some(1000));
        assert_eq!(Audience { slope: 0.0, offset: 100.0 }.seen_as(100.0), 100.0);
        assert_eq!(Audience { slope: 0.0, offset: 101.0 }.seen_as(100.0), 0.0);
    }

    /// A film of two tiles, the second much noisier, with `samples` samples.
    fn two_tiles(samples: u32) -> Film {
        let mut film = Film::new(TileGrid::new(128, 64, 64).unwrap());
        for tile in 0..2 {
            let half = |seed: usize| -> Vec<Rgb> {
                let sign =
                    |i: usize| if ((i * 7919 + seed * 104_729) / 31).is_multiple_of(2) { 1.0 } else { -1.0 };
                let sigma = if tile == 0 { 0.01 } else { 0.1 };
                (0..64 * 64).map(|i| [0.2 + sigma * sign(i); 3]).collect()
            };
            (1..=2).for_each(|seed| film.add(tile, samples / 2, &half(seed)).unwrap());
        }
        film
    }

    #[test]
    fn tiles_are_judged_in_their_picture_whoever_is_asked_about() {
        let (film, fresh) = (two_tiles(100), || Oracle::new(small(), DEFAULT_THRESHOLD).unwrap());
        let ask = |oracle: &mut Oracle, film: &Film, tiles: &[usize]| {
            let tiles: Vec<Tile> = tiles.iter().map(|&t| film.grid().tile(t)).collect();
            oracle.judge(&View { film, display: &Display::SRGB, reference: None }, &tiles).unwrap()
        };
        let both = ask(&mut fresh(), &film, &[0, 1]);
        assert_eq!(ask(&mut fresh(), &film, &[1, 0, 1]), [both[1], both[0], both[1]]);
        // What was found of another film is forgotten.
        let mut used = fresh();
        ask(&mut used, &two_tiles(400), &[0, 1]);
        assert_eq!(ask(&mut used, &film, &[0])[0], both[0]);
        assert_eq!(used.described, {
            let mut o = fresh();
            ask(&mut o, &film, &[0]);
            o.described
        });
    }

    #[test]
    fn the_paper_s_descriptor_judges_tiles_of_its_size_only() {
        let descriptor = Descriptor::MaskPair { mask: NoiseMask::default(), edge: 64 };
        let n = descriptor.len();
        assert_eq!(n, 2 * 64 * 64);
        let svm = Svm { gamma: 2.0, rho: 0.5, coefficients: vec![1.0], vectors: vec![0.0; n] };
        let model = Model { descriptor, scaler: Scaler::identity(n), svm, ..small() };
        let mut oracle = Oracle::new(model, DEFAULT_THRESHOLD).unwrap();
        // No noise, no mask: the support vector itself, f = 1 − ρ.
        let verdict = judge(&mut oracle, &film(100, 0.0), None).unwrap();
        assert!((verdict.probability.unwrap() - 1.0 / (1.0 + (-1f32).exp())).abs() < 1e-5);
        assert_eq!(verdict.expected_samples, None, "masks do not tell noise from picture");
        assert_eq!(oracle.just_visible(), None);
        let film = film(100, 0.0);
        let view = View { film: &film, display: &Display::SRGB, reference: None };
        assert_eq!(oracle.visible_noise(&view), None);

        let mut ragged = Film::new(TileGrid::new(40, 64, 64).unwrap());
        (0..2).for_each(|_| ragged.add(0, 1, &[[0.0; 3]; 40 * 64]).unwrap());
        let error = judge(&mut oracle, &ragged, None).unwrap_err();
        assert!(matches!(error, CriterionError::TileSize { expected: 64, width: 40, .. }), "{error}");
    }
}
