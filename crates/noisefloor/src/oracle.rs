//! The oracle: a trained model as a stopping criterion.

use crate::container;
use crate::criterion::{CriterionError, ExpectedThreshold, Needs, StoppingCriterion, Verdict, View};
use crate::descriptor::{Described, DescriptorError};
use crate::evidence::{Evidence, TilePlanes};
use crate::model::{Model, ProbabilityCurve};
use crate::params::Audience;
use crate::tile::{Tile, TileGrid};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

mod threshold;
pub use threshold::{Threshold, ThresholdError};

/// A tile with more than one in this many pixels without valid samples gives no evidence, and is not called
/// converged.
const NO_EVIDENCE: usize = 16;

/// Samples per pixel from which noise is trusted however it is distributed.
const TRUSTED_SPP: u64 = 100;

/// Share of the pixels of a tile that have to carry its noise for it to be trusted sooner.
const EVEN: f32 = 1.0 / 32.0;

/// How many pixels that has to be at least: the energy of their noise is then known to about a sixth.
const CARRIERS: f64 = 32.0;

/// Judges tiles by a trained model.
///
/// In a session, a tile with fewer than 100 samples per pixel is not called converged unless its noise is spread
/// over many pixels: noise that a few samples have made is not known yet, and neither is light that no sample has
/// found.
#[derive(Clone, Debug)]
pub struct Oracle {
    model: Model,
    threshold: Threshold,
    /// What tiles of the picture were like when last described, for the picture's numbers; of tiles by index.
    described: Vec<Option<Seen>>,
}

/// A tile as it was when last described.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Seen {
    tile: Described,
    /// Share of its pixels that carry its noise.
    spread: f32,
}

impl Oracle {
    /// An oracle that calls a tile converged where P reaches the threshold.
    pub fn new(model: Model, threshold: Threshold) -> Self {
        Self { model, threshold, described: Vec::new() }
    }

    /// The bundled model at P ≥ 0.9.
    #[cfg(feature = "bundled-model")]
    pub fn bundled() -> Self {
        Self::new(Model::bundled(), Threshold::PAPER)
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// P from which a tile counts as converged.
    pub fn threshold(&self) -> Threshold {
        self.threshold
    }

    /// Describes one tile of a picture by its planes, which have `spp` samples per pixel, above 0.
    /// [`Oracle::judge_described`] wants all tiles of the picture.
    ///
    /// # Errors
    /// [`CriterionError::TileSize`] if the model is for tiles of another size, [`CriterionError::Viewing`] if
    /// it is for other viewing conditions.
    pub fn describe(&self, planes: &TilePlanes, spp: f64) -> Result<Described, CriterionError> {
        let (trained, asked) = (self.model.viewing(), planes.viewing);
        if asked != trained && !self.model.descriptor().knows_viewing() {
            let (trained, asked) = (trained.to_string(), asked.to_string());
            return Err(CriterionError::Viewing { name: self.name(), trained, asked });
        }
        self.model.descriptor().describe_tile(planes, spp).map_err(|e| self.misfit(e))
    }

    /// Judges the tiles that make up a picture, or as many as there are of it: people see a tile in its
    /// picture, and so does the model. One verdict a tile.
    pub fn judge_described(&self, tiles: &[Described]) -> Vec<Verdict> {
        let numbers = self.model.descriptor().in_picture(tiles);
        tiles.iter().zip(numbers).map(|(tile, raw)| self.verdict(&raw, tile.spp.round() as u64)).collect()
    }

    /// Judges tiles as [`Oracle::judge_described`] does, for other eyes than those of the training data: P is
    /// the share of *them*, who see of n samples what trained observers see of [`Audience::seen_as`] n.
    /// `None` if that cannot be told, since the descriptor does not tell noise from picture, and the audience
    /// is not [`Audience::TRAINED`].
    pub fn judge_described_for(&self, tiles: &[Described], audience: Audience) -> Option<Vec<Verdict>> {
        if audience == Audience::TRAINED {
            return Some(self.judge_described(tiles));
        }
        let numbers = self.model.descriptor().in_picture(tiles);
        tiles.iter().zip(numbers).map(|(tile, raw)| self.verdict_for(raw, tile.spp, audience)).collect()
    }

    fn verdict_for(&self, mut raw: Vec<f32>, spp: f64, audience: Audience) -> Option<Verdict> {
        let seen_as = audience.seen_as(spp);
        // For someone who is never satisfied with so few samples, the need of the trained audience is sought
        // from one sample on.
        let from = seen_as.max(spp.min(1.0));
        if !self.model.descriptor().project(&mut raw, (from / spp) as f32) {
            return None;
        }
        let trained = self.verdict(&raw, from.round().max(1.0) as u64);
        let satisfied = seen_as > 0.0;
        let converged = satisfied && trained.converged;
        let expected_spp = if converged {
            Some(spp.round() as u64)
        } else {
            trained.expected_spp.map(|needed| audience.samples(needed))
        };
        let seen = |p: Option<f32>| if satisfied { p } else { Some(0.0) };
        Some(Verdict {
            converged,
            probability: seen(trained.probability),
            threshold: trained.threshold.map(|t| ExpectedThreshold {
                low: audience.samples(t.low),
                median: audience.samples(t.median),
                high: audience.samples(t.high),
            }),
            expected_spp,
            doubted: trained.doubted,
            unfamiliar: trained.unfamiliar,
            probability_without_penalty: seen(trained.probability_without_penalty),
        })
    }

    /// A verdict by a whole, raw descriptor.
    fn verdict(&self, raw: &[f32], spp: u64) -> Verdict {
        let mut curve = self.model.curve(raw);
        let judgement = curve.judgement();
        let converged = self.threshold.is_reached_by(judgement.probability);
        Verdict {
            converged,
            probability: Some(judgement.probability),
            threshold: expected_threshold(&mut curve, spp),
            expected_spp: if converged { Some(spp) } else { self.expect(&mut curve, spp) },
            doubted: false,
            unfamiliar: judgement.unfamiliar,
            probability_without_penalty: Some(judgement.probability_without_penalty),
        }
    }

    /// The visible noise, in the descriptor's unit, from which it is seen: of an even noise in a tile like the
    /// mean of the training data, where P crosses the threshold. `None` if the descriptor does not tell noise
    /// from picture.
    fn just_visible(&self) -> Option<f32> {
        let descriptor = self.model.descriptor();
        let mean = &self.model.classifier().scaler.mean;
        let at = |doublings: f32| {
            let mut raw = mean.clone();
            descriptor.project(&mut raw, doublings.exp2());
            raw
        };
        let (mut noisy, mut clean) = (-20.0f32, 20.0f32);
        while clean - noisy > 0.01 {
            let middle = 0.5 * (noisy + clean);
            let seen = !self.threshold.is_reached_by(self.model.judge(&at(middle)).probability);
            if seen { noisy = middle } else { clean = middle }
        }
        descriptor.pooled_visible_noise(&at(clean))
    }

    /// Whether [`Oracle::map_visible_noise`] can tell noise from picture.
    pub fn maps_visible_noise(&self) -> bool {
        self.just_visible().is_some()
    }

    /// The visible noise of a whole image, row-major, from the planes of its tiles; NaN where `planes` has
    /// none. 1 is the amplitude from which an even noise is seen, in a tile like the mean of the training
    /// data. `None` if the descriptor does not tell noise from picture.
    ///
    /// # Errors
    /// Those of `planes`.
    pub fn map_visible_noise<E: Send>(
        &self,
        grid: TileGrid,
        planes: impl Fn(Tile) -> Result<Option<TilePlanes>, E> + Sync,
    ) -> Result<Option<Vec<f32>>, E> {
        let Some(just_visible) = self.just_visible() else { return Ok(None) };
        let tiles: Vec<Tile> = grid.tiles().collect();
        let map_of = |&tile: &Tile| {
            Ok(planes(tile)?.map(|planes| {
                let map = self.model.descriptor().visible_noise(&planes);
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
                    pixels.zip(&map).for_each(|(pixel, &value)| image[pixel] = value / just_visible);
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
        let planes = match self.model.evidence() {
            Evidence::Halves => TilePlanes::from_halves(view.film, view.display, tile),
            Evidence::Reference => {
                let reference = view.reference.ok_or_else(|| CriterionError::NoReference(self.name()))?;
                TilePlanes::from_reference(view.film, view.display, reference, tile)
            }
            Evidence::Alone => TilePlanes::from_picture(view.film, view.display, tile),
        };
        Ok(Some(TilePlanes { viewing: view.viewing, ..planes }))
    }

    fn misfit(&self, error: DescriptorError) -> CriterionError {
        match error {
            DescriptorError::TileSize { expected, width, height } => {
                CriterionError::TileSize { name: self.name(), expected, width, height }
            }
            other => CriterionError::Descriptor(other),
        }
    }

    /// Samples per pixel at which P crosses the threshold if only the noise changes, as noise does: σ ∝ 1/√n.
    /// Found by doubling, then bisecting ln n; `None` if the descriptor does not separate noise from picture,
    /// or 2²⁰ times the samples are not enough.
    fn expect(&self, curve: &mut ProbabilityCurve<'_>, spp: u64) -> Option<u64> {
        let mut satisfied =
            |doublings: f32| curve.at(doublings.exp2()).map(|p| self.threshold.is_reached_by(p));
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
        Some((spp as f64 * f64::from(high).exp2()).ceil() as u64)
    }
}

/// Samples per pixel at which P is 10, 50 and 90 %, if only the noise changes; `None` if the descriptor does not separate
/// noise from picture, or one of them lies beyond 2²⁰ times the samples.
fn expected_threshold(curve: &mut ProbabilityCurve<'_>, spp: u64) -> Option<ExpectedThreshold> {
    let mut reaches = |p: f32| {
        // Doublings of the samples, from a million times fewer to a million times more
        let (mut low, mut high) = (-20.0f32, 20.0f32);
        if curve.without_penalty(high.exp2())? < p {
            return None;
        }
        while high - low > 0.01 {
            let middle = 0.5 * (low + high);
            if curve.without_penalty(middle.exp2())? >= p { high = middle } else { low = middle }
        }
        Some((spp as f64 * f64::from(high).exp2()).ceil() as u64)
    };
    Some(ExpectedThreshold { low: reaches(0.1)?, median: reaches(0.5)?, high: reaches(0.9)? })
}

impl StoppingCriterion for Oracle {
    fn name(&self) -> String {
        format!("svm oracle ({})", self.model.descriptor().name())
    }

    fn fingerprint(&self) -> String {
        format!("model {}, P ≥ {}", self.model.digest(), self.threshold)
    }

    fn begin(&mut self, grid: TileGrid) {
        self.described = vec![None; grid.len()];
    }

    fn needs(&self) -> Needs {
        match self.model.evidence() {
            Evidence::Halves => Needs::HALVES,
            Evidence::Reference => Needs::REFERENCE,
            Evidence::Alone => Needs::default(),
        }
    }

    fn audience(&self) -> Audience {
        self.model.audience()
    }

    fn visible_noise(&self, view: &View<'_>) -> Option<Vec<f32>> {
        self.map_visible_noise(view.film.grid(), |tile| self.planes(view, tile)).ok()?
    }

    /// Tiles that are not named count for the picture as they were when last described; they are described
    /// again if their samples have changed since.
    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let grid = view.film.grid();
        if self.described.len() != grid.len() {
            self.begin(grid);
        }
        let mut due = vec![false; grid.len()];
        tiles.iter().for_each(|t| due[t.index] = true);
        let this: &Self = self;
        let describe = |tile: Tile| {
            let spp = view.film.spp(tile.index) as f64;
            let known = this.described[tile.index].as_ref().filter(|d| d.tile.spp == spp && !due[tile.index]);
            if known.is_some() {
                return Ok(known.cloned());
            }
            let Some(planes) = this.planes(view, tile)? else { return Ok(None) };
            let described = this.describe(&planes, spp);
            let spread = planes.noise_spread();
            planes.recycle();
            described.map(|tile| Some(Seen { tile, spread }))
        };
        let all: Vec<Tile> = grid.tiles().collect();
        self.described = all.into_par_iter().map(describe).collect::<Result<_, _>>()?;

        // Judge all that can be seen, and hand out what was asked for.
        let seen: Vec<Described> = self.described.iter().flatten().map(|seen| seen.tile.clone()).collect();
        let mut judged = self.model.descriptor().in_picture(&seen).into_iter();
        let numbers: Vec<Option<Vec<f32>>> =
            self.described.iter().map(|d| d.as_ref().and_then(|_| judged.next())).collect();
        let asked: Vec<Option<Vec<f32>>> = tiles.iter().map(|t| numbers[t.index].clone()).collect();
        let judge = |(tile, raw): (&Tile, Option<Vec<f32>>)| match raw {
            Some(raw) => {
                let spp = view.film.spp(tile.index);
                let verdict = self.verdict(&raw, spp);
                let spread = self.described[tile.index].as_ref().map_or(0.0, |seen| seen.spread);
                let even = spread >= EVEN && f64::from(spread) * tile.pixels() as f64 >= CARRIERS;
                let doubted = spp < TRUSTED_SPP && !even;
                if doubted {
                    let expected_spp = verdict.expected_spp.map(|need| need.max(TRUSTED_SPP));
                    Verdict { converged: false, expected_spp, doubted, ..verdict }
                } else {
                    verdict
                }
            }
            None => Verdict {
                probability: Some(0.0),
                probability_without_penalty: Some(0.0),
                ..Verdict::default()
            },
        };
        Ok(tiles.par_iter().zip(asked).map(judge).collect())
    }

    /// How each tile was last described: stopped tiles count so for the picture, whatever has become of their
    /// neighbours, whose edges were read too.
    fn state(&self) -> Option<Vec<u8>> {
        container::payload(&self.described).ok()
    }

    fn restore(&mut self, grid: TileGrid, state: &[u8]) -> bool {
        let Ok(described) = container::unpack::<Vec<Option<Seen>>>(state) else { return false };
        let sound = |Seen { tile: d, spread }: &Seen| {
            spread.is_finite()
                && d.own.len() == self.model.descriptor().own_len()
                && d.own.iter().all(|v| v.is_finite())
                && [d.spp, d.area].iter().all(|v| v.is_finite() && *v > 0.0)
        };
        let fits = [0, grid.len()].contains(&described.len()) && described.iter().flatten().all(sound);
        if fits {
            self.described = described;
        }
        fits
    }
}

#[cfg(test)]
mod tests;
