//! The oracle: a trained model as a stopping criterion.

use crate::container;
use crate::criterion::{CriterionError, ExpectedThreshold, Needs, StoppingCriterion, Verdict, View};
use crate::descriptor::{Described, DescriptorError};
use crate::evidence::{Evidence, TilePlanes};
use crate::model::{Model, ProbabilityCurve};
use crate::params::Audience;
use crate::tile::{Tile, TileGrid};
use noisefloor_vision::Viewing;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

mod people;
pub use people::{People, PeopleError, Spread};

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
    people: People,
    /// How much the thresholds of these people scatter, where they were measured.
    scatter: Option<f64>,
    /// What tiles of the picture were like when last described, for the picture's numbers; of tiles by index.
    described: Vec<Option<LastDescribed>>,
}

/// A tile as it was when last described.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct LastDescribed {
    tile: Described,
    /// Share of its pixels that carry its noise.
    spread: f32,
}

impl Oracle {
    /// An oracle that calls a tile converged where that share of people sees no noise in it.
    pub fn new(model: Model, people: People) -> Self {
        Self { model, people, scatter: None, described: Vec::new() }
    }

    /// The bundled model, for 95 % of people.
    #[cfg(feature = "bundled-model")]
    pub fn bundled() -> Self {
        Self::new(Model::bundled(), People::DEFAULT)
    }

    /// For people whose eyes were measured: the standard deviation of ln(samples) that this leaves, above 0, instead
    /// of that between people. What they were measured to need is [`crate::Params::audience`].
    pub fn with_scatter(self, scatter: f64) -> Self {
        Self { scatter: Some(scatter.clamp(1e-3, 10.0)), ..self }
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The share of people who are to see no noise.
    pub fn people(&self) -> People {
        self.people
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
            brightness_differs: false,
        })
    }

    /// A verdict by a whole, raw descriptor.
    fn verdict(&self, raw: &[f32], spp: u64) -> Verdict {
        let mut curve = self.model.curve(raw, self.scatter);
        let judgement = curve.judgement();
        let converged = self.people.are_satisfied_by(judgement.probability);
        Verdict {
            converged,
            probability: Some(judgement.probability),
            threshold: expected_threshold(&mut curve, spp),
            expected_spp: if converged {
                Some(spp)
            } else {
                // If only the noise changes, as noise does: σ ∝ 1/√n
                self.crossing(|factor| curve.at(factor)).map(|f| (spp as f64 * f64::from(f)).ceil() as u64)
            },
            doubted: false,
            unfamiliar: judgement.unfamiliar,
            probability_without_penalty: Some(judgement.probability_without_penalty),
            brightness_differs: false,
        }
    }

    /// Whether [`Oracle::map_visible_noise`] can tell noise from picture.
    pub fn maps_visible_noise(&self) -> bool {
        self.model.descriptor().visible_noise(&[]).is_some()
    }

    /// The visible noise of a whole image, row-major, from its tiles as described; NaN where there is none of them.
    /// 1 is the amplitude at which [`Oracle::people`] of that audience see none: a tile that these
    /// numbers call converged is nowhere above 1, and one
    /// that is not is above 1 somewhere. `None` if the descriptor does not tell noise from picture.
    pub fn map_visible_noise(
        &self,
        grid: TileGrid,
        tiles: &[Described],
        audience: Audience,
    ) -> Option<Vec<f32>> {
        let maps = self.model.descriptor().visible_noise(tiles)?;
        let numbers = self.model.descriptor().in_picture(tiles);
        let mut image = vec![f32::NAN; grid.width() * grid.height()];
        for ((tile, map), raw) in tiles.iter().zip(&maps).zip(&numbers) {
            let mut curve = self.model.curve(raw, self.scatter);
            // Noise as strong as in the worst window needs this many times the samples
            let needed = self.crossing(|factor| curve.at(factor)).map_or(f32::INFINITY, |trained| {
                let wanted = audience.needed(f64::from(trained) * tile.spp) / tile.spp;
                wanted as f32
            });
            let worst = map.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
            let pixels = tile.place.rows(grid.width()).flatten();
            pixels.zip(map).for_each(|(pixel, &value)| image[pixel] = value / worst * needed.sqrt());
        }
        Some(image)
    }

    /// How many times the samples P reaches what is asked for, within 2±²⁰, to a hundredth of a doubling; `None` if
    /// 2²⁰ are not enough, or it cannot be told.
    fn crossing(&self, mut probability: impl FnMut(f32) -> Option<f32>) -> Option<f32> {
        let (mut low, mut high) = (-20.0f32, 20.0f32);
        if !self.people.are_satisfied_by(probability(high.exp2())?) {
            return None;
        }
        while high - low > 0.01 {
            let middle = 0.5 * (low + high);
            if self.people.are_satisfied_by(probability(middle.exp2())?) {
                high = middle
            } else {
                low = middle
            }
        }
        Some(high.exp2())
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
        format!("{} oracle ({})", self.model.classifier().machine.name(), self.model.descriptor().name())
    }

    fn fingerprint(&self) -> String {
        let scatter = self.scatter.map(|s| format!(", measured within {s}")).unwrap_or_default();
        format!("model {}, {} of people{scatter}", self.model.digest(), self.people)
    }

    fn begin(&mut self, grid: TileGrid) {
        self.described = vec![None; grid.len()];
    }

    fn needs(&self) -> Needs {
        match self.model.evidence() {
            Evidence::Halves => Needs::HALVES,
            Evidence::Reference => Needs::REFERENCE,
        }
    }

    fn audience(&self) -> Audience {
        self.model.audience()
    }

    /// See [`Spread::share_in_picture`]; `None` if the model knows nothing of how thresholds scatter.
    fn share_in_picture(&self, viewing: Viewing, tiles: &[(f32, usize)]) -> Option<f64> {
        let spread = self.model.spread()?;
        let spread = Spread { people: self.scatter.unwrap_or(spread.people), ..spread };
        let places =
            |&(share, pixels): &(f32, usize)| (share, Spread::places(pixels, viewing.pixels_per_degree()));
        Some(spread.share_in_picture(tiles.iter().map(places)))
    }

    fn visible_noise(&self, view: &View<'_>) -> Option<Vec<f32>> {
        let grid = view.film.grid();
        let describe = |tile: Tile| {
            let planes = self.planes(view, tile).ok()??;
            let described = self.describe(&planes, view.film.spp(tile.index) as f64).ok();
            planes.recycle();
            described
        };
        let tiles: Vec<Tile> = grid.tiles().collect();
        let described: Vec<Option<Described>> = tiles.into_par_iter().map(describe).collect();
        let audience = self.audience().then(view.audience);
        self.map_visible_noise(grid, &described.into_iter().flatten().collect::<Vec<_>>(), audience)
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
            described.map(|tile| Some(LastDescribed { tile, spread }))
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
        let Ok(described) = container::unpack::<Vec<Option<LastDescribed>>>(state) else { return false };
        let sound = |(tile, seen): (Tile, &Option<LastDescribed>)| {
            let Some(LastDescribed { tile: d, spread }) = seen else { return true };
            spread.is_finite()
                && d.place == tile
                && d.spp.is_finite()
                && d.spp > 0.0
                && self.model.descriptor().is_sound(d)
        };
        let fits = [0, grid.len()].contains(&described.len()) && grid.tiles().zip(&described).all(sound);
        if fits {
            self.described = described;
        }
        fits
    }
}

#[cfg(test)]
mod tests;
