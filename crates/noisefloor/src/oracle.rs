//! The oracle: a trained model as a stopping criterion.

#[cfg(feature = "files")]
use crate::container;
use crate::criterion::{CriterionError, ExpectedThreshold, Needs, OpenFor, StoppingCriterion, Verdict, View};
use crate::descriptor::{Described, DescriptorError};
use crate::evidence::{Evidence, Shown, TilePlanes};
use crate::model::{Model, ProbabilityCurve};
use crate::params::Audience;
use crate::people::Unknown;
use crate::tile::{Tile, TileGrid};
use crate::unmet::{MetOnce, Unmet};
use noisefloor_vision::Viewing;
use rayon::prelude::*;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};

#[doc(hidden)]
pub use crate::people::Spread;
pub use crate::people::{People, PeopleError};

/// A tile with more than one in this many pixels without valid samples gives no evidence, and is not called
/// converged.
const NO_EVIDENCE: usize = 16;

/// How many tiles beside each other are shown together, at most: more would leave threads without work.
const SHOWN_TOGETHER: usize = 4;

/// How many times the light that a tile has been found to lack unseen is looked at again.
const MORE: f64 = 1.25;

/// Judges tiles by a trained model.
///
/// What is not known yet is part of P: the exposure by its standard error, noise by how few pixels carry it, texture that the
/// model was not tried on. And a tile has converged only if P is large enough with the light that it is likely to
/// lack: by what only one half of the samples has met around it, or in its picture, and by what none may have met.
/// [`Verdict::open_for`] says which of these decides. Where more such light is found later, the verdict is taken back
/// ([`StoppingCriterion::revised`]).
#[derive(Clone, Debug)]
pub struct Oracle {
    model: Model,
    people: People,
    /// How much the thresholds of these people scatter, where they were measured.
    scatter: Option<f64>,
    /// What tiles of the picture were like when last described, for the picture's numbers; of tiles by index.
    described: Vec<Option<LastDescribed>>,
    /// Verdicts that were not asked for, until they are fetched.
    revised: Vec<(Tile, Verdict)>,
}

/// A tile as it was when last described.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
struct LastDescribed {
    tile: Described,
    /// How many of its pixels carry its noise.
    carriers: f64,
    /// What only one half has met in it.
    met_once: MetOnce,
    /// Mean radiance that it may have lacked, and nobody would have seen; `None` while it is not done.
    lacked: Option<f64>,
}

pub(crate) struct Judged {
    /// One for each tile asked about, with whether it is all that the audience asks for.
    pub verdicts: Vec<(Verdict, bool)>,
    /// What each tile of the picture is judged by.
    pub described: Vec<Option<Described>>,
}

impl Oracle {
    /// An oracle that calls a tile converged where that share of people sees no noise in it.
    pub fn new(model: Model, people: People) -> Self {
        Self { model, people, scatter: None, described: Vec::new(), revised: Vec::new() }
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

    fn verdict_for(&self, mut raw: Vec<f32>, spp: f64, audience: Audience) -> Option<Verdict> {
        let seen_as = audience.seen_as(spp);
        // For someone who is never satisfied with so few samples, the need of the trained audience is sought
        // from one sample on.
        let from = seen_as.max(spp.min(1.0));
        if !self.model.parts().descriptor.project(&mut raw, (from / spp) as f32) {
            return None;
        }
        let trained = self.verdict(&raw, from.round().max(1.0) as u64, Unknown::default());
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
            open_for: if satisfied { trained.open_for } else { Some(OpenFor::Noise) },
            probability: seen(trained.probability),
            threshold: trained.threshold.map(|threshold| threshold.map(|spp| audience.samples(spp))),
            expected_spp,
            unfamiliar: trained.unfamiliar,
            probability_without_penalty: seen(trained.probability_without_penalty),
            ..Verdict::default()
        })
    }

    /// A verdict by a whole, raw descriptor, and by what is not known beside it.
    fn verdict(&self, raw: &[f32], spp: u64, unknown: Unknown) -> Verdict {
        let mut curve = self.model.parts().curve(raw, self.scatter).within(unknown);
        let judgement = curve.judgement();
        let converged = self.people.are_satisfied_by(judgement.probability);
        let without = |unknown| self.model.parts().curve(raw, self.scatter).within(unknown).judgement();
        let open_for = match converged {
            true => None,
            false if !self.people.are_satisfied_by(without(Unknown::default()).probability) => {
                Some(OpenFor::Noise)
            }
            false if unknown.exposure > unknown.noise => Some(OpenFor::Exposure),
            false => Some(OpenFor::FewSamples),
        };
        Verdict {
            converged,
            open_for,
            probability: Some(judgement.probability),
            threshold: expected_threshold(&mut curve, spp),
            expected_spp: if converged {
                Some(spp)
            } else {
                // If only the noise changes, as noise does: σ ∝ 1/√n
                self.crossing(|factor| curve.at(factor)).map(|f| (spp as f64 * f64::from(f)).ceil() as u64)
            },
            unfamiliar: judgement.unfamiliar,
            probability_without_penalty: Some(judgement.probability_without_penalty),
            ..Verdict::default()
        }
    }

    /// Whether the model tells noise from picture, so that [`Session::visible_noise`](crate::Session::visible_noise) and
    /// [`tune`](crate::tune) can say how visible noise is.
    pub fn maps_visible_noise(&self) -> bool {
        self.model.parts().descriptor.visible_noise(&[]).is_some()
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

    /// What a tile is judged by, alone or of several that are shown together; `None` if too many of its pixels have no
    /// evidence.
    fn planes(
        &self,
        view: &View<'_>,
        shown: Option<&Shown>,
        tile: Tile,
    ) -> Result<Option<TilePlanes>, CriterionError> {
        if view.film.unsampled_pixels(tile.index) > tile.pixels() / NO_EVIDENCE {
            return Ok(None);
        }
        let planes = match (self.model.evidence(), shown) {
            (Evidence::Halves, Some(shown)) => shown.planes(tile),
            (Evidence::Halves, None) => TilePlanes::from_halves(view.film, view.display, tile),
            (Evidence::Reference, _) => {
                let reference = view.reference.ok_or_else(|| CriterionError::NoReference(self.name()))?;
                TilePlanes::from_reference(view.film, view.display, reference, tile)
            }
        };
        Ok(Some(TilePlanes { viewing: view.viewing, ..planes }))
    }

    /// What tiles are like now, which are in the order of the grid; `None` for one of which too many pixels have no
    /// evidence.
    fn look_at(
        &self,
        view: &View<'_>,
        tiles: &[Tile],
    ) -> Result<impl Iterator<Item = Option<LastDescribed>> + use<>, CriterionError> {
        let beside = |a: &Tile, b: &Tile| a.y == b.y && a.index + 1 == b.index;
        let runs: Vec<&[Tile]> = tiles.chunk_by(beside).flat_map(|run| run.chunks(SHOWN_TOGETHER)).collect();
        let look_at_run = |run: &&[Tile]| {
            let of_halves = self.model.evidence() == Evidence::Halves;
            let shown = of_halves.then(|| Shown::of_halves(view.film, view.display, run));
            let seen: Result<Vec<_>, _> =
                run.iter().map(|&tile| self.look_at_one(view, shown.as_ref(), tile)).collect();
            shown.into_iter().for_each(Shown::recycle);
            seen
        };
        let seen: Vec<Vec<Option<LastDescribed>>> =
            runs.par_iter().map(look_at_run).collect::<Result<_, _>>()?;
        Ok(seen.into_iter().flatten())
    }

    fn look_at_one(
        &self,
        view: &View<'_>,
        shown: Option<&Shown>,
        tile: Tile,
    ) -> Result<Option<LastDescribed>, CriterionError> {
        let Some(planes) = self.planes(view, shown, tile)? else { return Ok(None) };
        let described = self.describe(&planes, view.film.spp(tile.index) as f64);
        let carriers = planes.noise_carriers();
        planes.recycle();
        let met_once = MetOnce::of(view.film, view.display, tile);
        described.map(|tile| Some(LastDescribed { tile, carriers, met_once, lacked: None }))
    }

    /// Judges all tiles of a picture, without a memory, and says how visible noise is at each of its pixels; `None` if the model
    /// does not tell noise from picture.
    pub(crate) fn judge_all(
        &self,
        view: &View<'_>,
    ) -> Result<(Vec<Verdict>, Option<Vec<f32>>), CriterionError> {
        let tiles: Vec<Tile> = view.film.grid().tiles().collect();
        let seen: Vec<Option<LastDescribed>> = self.look_at(view, &tiles)?.collect();
        let Judged { verdicts, described } = self.judge_seen(view, &seen, &tiles)?;
        let audience = self.audience().then(view.audience);
        let described: Vec<Described> = described.into_iter().flatten().collect();
        let map = self.map_visible_noise(view.film.grid(), &described, audience);
        Ok((verdicts.into_iter().map(|(verdict, _)| verdict).collect(), map))
    }

    /// Judges tiles of a picture: those that only light could keep open, with the light that they are likely to
    /// lack.
    fn judge_seen(
        &self,
        view: &View<'_>,
        seen: &[Option<LastDescribed>],
        tiles: &[Tile],
    ) -> Result<Judged, CriterionError> {
        let unknown = |seen: &LastDescribed| Unknown::new(view.exposure_error, seen.carriers);
        let unknown: Vec<Unknown> =
            seen.iter().map(|seen| seen.as_ref().map(unknown).unwrap_or_default()).collect();
        let mut described: Vec<Option<Described>> =
            seen.iter().map(|s| s.as_ref().map(|s| s.tile.clone())).collect();
        let judge = |described: &[Option<Described>]| {
            let verdicts = self.judge_noise(view, described, &unknown, tiles);
            let enough =
                |(tile, v): (&Tile, Verdict)| (v, self.is_enough(view, &v, view.film.spp(tile.index)));
            tiles.iter().zip(verdicts).map(enough).collect::<Vec<_>>()
        };
        let unmet = Unmet::new(view.film, view.display, met_once(seen), view.viewing);
        let lit = |tile: Tile| {
            let Some(mut shown) = unmet.shown(view.film, view.display, tile) else { return Ok(None) };
            // Who stands more noise, and so has enough with `slope` times the samples, does not stand more missing light
            let slope = self.audience().then(view.audience).slope;
            if slope < 1.0 {
                let stronger = 1.0 / slope.max(1e-6).sqrt() as f32;
                shown.residual.values_mut().iter_mut().for_each(|light| *light *= stronger);
            }
            let Some(planes) = self.planes(view, None, tile)? else { return Ok(None) };
            let lit = self.with_light(planes, shown, view.film.spp(tile.index) as f64)?;
            Ok(Some((lit, unmet.kind(view.film, tile))))
        };
        let by_noise = judge(&described);
        let verdicts = judge_with_light(by_noise, &mut described, tiles, judge, lit)?;
        Ok(Judged { verdicts, described })
    }

    /// Verdicts on these tiles by the noise of all, and by what is not known of each.
    fn judge_noise(
        &self,
        view: &View<'_>,
        described: &[Option<Described>],
        unknown: &[Unknown],
        tiles: &[Tile],
    ) -> Vec<Verdict> {
        let seen: Vec<Described> = described.iter().flatten().cloned().collect();
        let mut judged = self.model.parts().descriptor.in_picture(&seen).into_iter();
        let numbers: Vec<Option<Vec<f32>>> =
            described.iter().map(|d| d.as_ref().and_then(|_| judged.next())).collect();
        let judge = |tile: &Tile| match &numbers[tile.index] {
            Some(raw) => self.verdict(raw, view.film.spp(tile.index), unknown[tile.index]),
            None => Verdict {
                probability: Some(0.0),
                probability_without_penalty: Some(0.0),
                ..Verdict::new(false).kept_open_by(OpenFor::FewSamples)
            },
        };
        tiles.par_iter().map(judge).collect()
    }

    /// Whether a verdict is all that this audience asks for; a session stops tiles for less demanding ones where
    /// their need is expected to be met.
    fn is_enough(&self, view: &View<'_>, verdict: &Verdict, spp: u64) -> bool {
        let audience = self.audience().then(view.audience);
        verdict.converged
            || (audience.slope < 1.0
                && verdict.expected_spp.is_some_and(|need| audience.samples(need) <= spp))
    }

    /// A tile as it would be with the light that it is likely to lack.
    fn with_light(
        &self,
        mut planes: TilePlanes,
        light: TilePlanes,
        spp: f64,
    ) -> Result<Described, CriterionError> {
        // Either sign of the difference of the halves is as good, and light has one: that which does not hang on which
        // half is which
        let sum: f64 = planes.residual.values().iter().map(|&r| f64::from(r)).sum();
        let sign = if sum < 0.0 { -1.0 } else { 1.0 };
        let lit = |r: &mut f32, light: f32| *r = sign * *r + light;
        let residual = planes.residual.values_mut().iter_mut();
        residual.zip(light.residual.values()).for_each(|(r, light)| lit(r, *light));
        if let Some(colour) = &mut planes.colour {
            for plane in &mut colour.residual {
                let residual = plane.values_mut().iter_mut().zip(light.residual.values());
                residual.for_each(|(r, light)| lit(r, *light));
            }
        }
        light.recycle();
        let described = self.describe(&planes, spp);
        planes.recycle();
        described
    }

    /// Judges tiles of two finished pictures for an audience, by what they are like and, where only it could keep them open,
    /// with the `light` that they are likely to lack, on the planes of the tile. `None` if nobody can tell what this audience sees.
    pub(crate) fn judge_finished<E: From<CriterionError> + Send>(
        &self,
        described: Vec<Described>,
        audience: Audience,
        light: impl Fn(Tile) -> Result<Option<([TilePlanes; 2], OpenFor)>, E> + Sync,
    ) -> Result<Option<Judged>, E> {
        let Some(by_noise) = self.judge_described_for(&described, audience) else { return Ok(None) };
        let enough = |verdict: Verdict| (verdict, verdict.converged);
        let tiles: Vec<Tile> = described.iter().map(|d| d.place).collect();
        let spp = described.first().map_or(1.0, |d| d.spp);
        let mut described: Vec<Option<Described>> = described.into_iter().map(Some).collect();
        let judge = |described: &[Option<Described>]| {
            let described: Vec<Described> = described.iter().flatten().cloned().collect();
            self.judge_described_for(&described, audience).into_iter().flatten().map(enough).collect()
        };
        let lit = |tile: Tile| -> Result<Option<(Described, OpenFor)>, E> {
            match light(tile)? {
                Some(([planes, light], kind)) => Ok(Some((self.with_light(planes, light, spp)?, kind))),
                None => Ok(None),
            }
        };
        let by_noise = by_noise.into_iter().map(enough).collect();
        let verdicts = judge_with_light(by_noise, &mut described, &tiles, judge, lit)?;
        Ok(Some(Judged { verdicts, described }))
    }

    /// What stands before and after the share of people in the fingerprint.
    fn around_people(&self) -> [String; 2] {
        let scatter = self.scatter.map(|s| format!(", measured within {s}")).unwrap_or_default();
        [format!("model {}, ", self.model.fingerprint()), format!(" of people{scatter}, unknown 1")]
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

/// What describes tiles one by one, for whoever has the parts that verdicts are made of.
#[doc(hidden)]
impl Oracle {
    /// Describes one tile of a picture by its planes, which have `spp` samples per pixel, above 0.
    /// [`Oracle::judge_described`] wants all tiles of the picture.
    ///
    /// # Errors
    /// [`CriterionError::TileSize`] if the model is for tiles of another size, [`CriterionError::Viewing`] if
    /// it is for other viewing conditions.
    pub fn describe(&self, planes: &TilePlanes, spp: f64) -> Result<Described, CriterionError> {
        let (trained, asked) = (self.model.viewing(), planes.viewing);
        if asked != trained && !self.model.parts().descriptor.knows_viewing() {
            let (trained, asked) = (trained.to_string(), asked.to_string());
            return Err(CriterionError::Viewing { name: self.name(), trained, asked });
        }
        self.model.parts().descriptor.describe_tile(planes, spp).map_err(|e| self.misfit(e))
    }

    /// Judges the tiles that make up a picture, or as many as there are of it: people see a tile in its
    /// picture, and so does the model. One verdict a tile.
    pub fn judge_described(&self, tiles: &[Described]) -> Vec<Verdict> {
        self.judge_described_for(tiles, Audience::TRAINED).unwrap_or_default()
    }

    /// Judges tiles as [`Oracle::judge_described`] does, for other eyes than those of the training data: P is
    /// the share of *them*, who see of n samples what trained observers see of [`Audience::seen_as`] n.
    /// `None` if that cannot be told, since the descriptor does not tell noise from picture, and the audience
    /// is not [`Audience::TRAINED`].
    pub fn judge_described_for(&self, tiles: &[Described], audience: Audience) -> Option<Vec<Verdict>> {
        let numbers = self.model.parts().descriptor.in_picture(tiles);
        let judge = |(tile, raw): (&Described, Vec<f32>)| match audience {
            Audience::TRAINED => Some(self.verdict(&raw, tile.spp.round() as u64, Unknown::default())),
            _ => self.verdict_for(raw, tile.spp, audience),
        };
        tiles.iter().zip(numbers).map(judge).collect()
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
        let maps = self.model.parts().descriptor.visible_noise(tiles)?;
        let numbers = self.model.parts().descriptor.in_picture(tiles);
        let mut image = vec![f32::NAN; grid.width() * grid.height()];
        for ((tile, map), raw) in tiles.iter().zip(&maps).zip(&numbers) {
            let mut curve = self.model.parts().curve(raw, self.scatter);
            // Noise as strong as in the worst window needs this many times the samples
            let needed = self.crossing(|factor| curve.at(factor)).map_or(f32::INFINITY, |trained| {
                let wanted = audience.needed(f64::from(trained) * tile.spp) / tile.spp;
                wanted as f32
            });
            let worst = map.values().iter().copied().fold(f32::MIN_POSITIVE, f32::max);
            let pixels = tile.place.rows(grid.width()).flatten();
            pixels.zip(map.values()).for_each(|(pixel, &value)| image[pixel] = value / worst * needed.sqrt());
        }
        Some(image)
    }
}

/// Verdicts on these tiles: by noise, and of those that are enough by `judge` with the light that they may lack, as `lit`
/// describes them; where that is not enough, they are open for it. `described` has then what each tile is judged by.
fn judge_with_light<E: Send>(
    by_noise: Vec<(Verdict, bool)>,
    described: &mut [Option<Described>],
    tiles: &[Tile],
    judge: impl FnOnce(&[Option<Described>]) -> Vec<(Verdict, bool)>,
    lit: impl Fn(Tile) -> Result<Option<(Described, OpenFor)>, E> + Sync,
) -> Result<Vec<(Verdict, bool)>, E> {
    let found: Vec<Option<(Described, OpenFor)>> = (tiles, &by_noise)
        .into_par_iter()
        .map(|(&tile, (_, enough))| if *enough { lit(tile) } else { Ok(None) })
        .collect::<Result<_, _>>()?;
    if found.iter().all(Option::is_none) {
        return Ok(by_noise);
    }
    let kinds: Vec<Option<OpenFor>> = found.iter().map(|lit| lit.as_ref().map(|(_, kind)| *kind)).collect();
    for (tile, lit) in tiles.iter().zip(found) {
        described[tile.index] = lit.map(|(lit, _)| lit).or(described[tile.index].take());
    }
    // Of a tile whose noise is not seen, its own light decides, or that of its neighbours
    let verdicts = by_noise.into_iter().zip(judge(described)).zip(kinds);
    let worse = verdicts.map(|((noise, light), kind)| match (noise.1, light.1) {
        (true, true) => light,
        (true, false) => (light.0.kept_open_by(kind.unwrap_or(OpenFor::UnmetLight)), false),
        (false, _) => noise,
    });
    Ok(worse.collect())
}

/// What each tile has met once.
fn met_once(seen: &[Option<LastDescribed>]) -> Vec<Option<MetOnce>> {
    seen.iter().map(|seen| seen.as_ref().map(|seen| seen.met_once)).collect()
}

/// Samples per pixel at which P is 10, 50 and 90 %, if only the noise changes; `None` if the descriptor does not separate
/// noise from picture, or one of them lies beyond 2²⁰ times the samples.
fn expected_threshold(curve: &mut ProbabilityCurve<'_>, spp: u64) -> Option<ExpectedThreshold> {
    let mut reaches = |p: f32| {
        // Doublings of the samples, from a million times fewer to a million times more
        let (mut low, mut high) = (-20.0f32, 20.0f32);
        if curve.known(high.exp2())? < p {
            return None;
        }
        while high - low > 0.01 {
            let middle = 0.5 * (low + high);
            if curve.known(middle.exp2())? >= p { high = middle } else { low = middle }
        }
        Some((spp as f64 * f64::from(high).exp2()).ceil() as u64)
    };
    Some(ExpectedThreshold { low: reaches(0.1)?, median: reaches(0.5)?, high: reaches(0.9)? })
}

impl StoppingCriterion for Oracle {
    fn name(&self) -> String {
        format!(
            "{} oracle ({})",
            self.model.parts().classifier.machine.name(),
            self.model.parts().descriptor.name()
        )
    }

    fn fingerprint(&self) -> String {
        let [before, after] = self.around_people();
        format!("{before}{}{after}", self.people)
    }

    /// Where more people are to see no noise.
    fn asks_for_more_than(&self, fingerprint: &str) -> bool {
        let [before, after] = self.around_people();
        let people = fingerprint.strip_prefix(&before).and_then(|rest| rest.strip_suffix(&after));
        people
            .and_then(|people| people.parse::<People>().ok())
            .is_some_and(|p| p.share() < self.people.share())
    }

    fn begin(&mut self, grid: TileGrid) {
        self.described = vec![None; grid.len()];
        self.revised.clear();
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

    /// From how thresholds scatter between scenes and people; `None` if the model knows nothing of how thresholds scatter.
    fn share_in_picture(&self, viewing: Viewing, tiles: &[(f32, usize)]) -> Option<f64> {
        let spread = self.model.parts().spread?;
        let spread = Spread { people: self.scatter.unwrap_or(spread.people), ..spread };
        let places =
            |&(share, pixels): &(f32, usize)| (share, Spread::places(pixels, viewing.pixels_per_degree()));
        Some(spread.share_in_picture(tiles.iter().map(places)))
    }

    fn visible_noise(&self, view: &View<'_>) -> Option<Vec<f32>> {
        self.judge_all(view).ok()?.1
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
        let all: Vec<Tile> = grid.tiles().collect();
        let changed = |tile: &Tile| {
            let spp = view.film.spp(tile.index) as f64;
            due[tile.index] || self.described[tile.index].as_ref().is_none_or(|d| d.tile.spp != spp)
        };
        let mut to_describe = all.clone();
        to_describe.retain(changed);
        for (tile, seen) in to_describe.iter().zip(self.look_at(view, &to_describe)?) {
            self.described[tile.index] = seen;
        }

        // Tiles that were called converged without what has been met elsewhere since are judged again
        let unmet = Unmet::new(view.film, view.display, met_once(&self.described), view.viewing);
        let grown = |tile: &Tile| {
            let lacked = self.described[tile.index].as_ref().and_then(|seen| seen.lacked);
            !due[tile.index] && lacked.is_some_and(|was| unmet.light(view.film, *tile) > MORE * was)
        };
        let again = all.into_iter().filter(grown);
        let asked: Vec<Tile> = tiles.iter().copied().chain(again).collect();

        // Hand out what was asked for.
        let mut verdicts = self.judge_seen(view, &self.described, &asked)?.verdicts;
        let mut revised = Vec::new();
        for (tile, (verdict, enough)) in asked.iter().zip(&verdicts) {
            let shows = || unmet.shown(view.film, view.display, *tile).is_some();
            let opens = !due[tile.index] && !enough && shows();
            if opens {
                revised.push((*tile, *verdict));
            }
            if let Some(seen) = &mut self.described[tile.index] {
                let done = if due[tile.index] { *enough } else { !opens };
                seen.lacked = done.then(|| unmet.light(view.film, *tile));
            }
        }
        self.revised = revised;
        verdicts.truncate(tiles.len());
        Ok(verdicts.into_iter().map(|(verdict, _)| verdict).collect())
    }

    fn revised(&mut self) -> Vec<(Tile, Verdict)> {
        std::mem::take(&mut self.revised)
    }

    /// How each tile was last described: stopped tiles count so for the picture, whatever has become of their
    /// neighbours, whose edges were read too.
    #[cfg(feature = "files")]
    fn state(&self) -> Option<Vec<u8>> {
        container::payload(&self.described).ok()
    }

    #[cfg(feature = "files")]
    fn restore(&mut self, grid: TileGrid, state: &[u8]) -> bool {
        let Ok(described) = container::unpack::<Vec<Option<LastDescribed>>>(state) else { return false };
        let sound = |(tile, seen): (Tile, &Option<LastDescribed>)| {
            let Some(LastDescribed { tile: d, carriers, met_once, lacked }) = seen else { return true };
            carriers.is_finite()
                && *carriers >= 0.0
                && met_once.is_sound()
                && lacked.is_none_or(|light| light.is_finite() && light >= 0.0)
                && d.place == tile
                && d.spp.is_finite()
                && d.spp > 0.0
                && self.model.parts().descriptor.is_sound(d)
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
