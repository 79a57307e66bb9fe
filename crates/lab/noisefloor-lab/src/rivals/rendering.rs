//! A rendering that criteria can follow, synthesised from the few pictures of a corpus.

use super::noise::Noise;
use crate::error::LabError;
use noisefloor::{
    Params, Rgb, Schedule, Session, StoppingCriterion, ToneMapping, Viewing, session::Interruption,
    source::Reference,
};
use noisefloor_learn::{Corpus, JudgedImage, JudgedZone, as_difference};
use rayon::prelude::*;

/// Samples of one stage over those of the stage before.
pub(super) const GROWTH: f64 = 1.15;
/// The last stage over the last picture. What people saw near the last picture, the difference from it, is weaker
/// than its noise: at this factor it is that of 80 % of the last picture's samples.
const BEYOND: f64 = 4.0;

/// A scene as a rendering that can be followed.
pub(super) struct SynthesisedRendering {
    pub(super) zones: Vec<JudgedZone>,
    /// Edge of a zone in pixels.
    edge: usize,
    /// What comes stage by stage: a batch for each half.
    stages: Vec<Vec<Batch>>,
    /// All zones, converged, as one picture.
    converged: Reference,
}

/// Samples, and the mean of only these samples for each zone.
type Batch = (u64, Vec<Vec<Rgb>>);

/// The samples of the batches of each stage, until `last` are reached: two batches each, so that the halves of a
/// film are even.
pub(super) fn stages(first: f64, last: f64) -> Vec<[u64; 2]> {
    let (mut stages, mut done, mut goal) = (Vec::new(), 0u64, first / GROWTH.powi(2));
    while (done as f64) < last {
        let half = ((goal / 2.0 - done as f64 / 2.0).round() as u64).max(1);
        stages.push([half; 2]);
        done += 2 * half;
        goal *= GROWTH;
    }
    stages
}

impl SynthesisedRendering {
    pub(super) fn of(corpus: &Corpus, scene: &str) -> Result<Self, LabError> {
        let zones: Vec<_> = corpus.zones().iter().filter(|z| z.row.scene == scene).cloned().collect();
        let edge = zones[0].row.width;
        if zones.iter().any(|z| z.row.width != edge || z.row.height != edge) {
            return Err(LabError::Zones { scene: scene.to_owned() });
        }
        let mut levels: Vec<Vec<JudgedImage>> = zones.iter().map(|_| Vec::new()).collect();
        for level in corpus.scene_levels(scene)? {
            let level = level?;
            if let Some(i) = zones.iter().position(|z| z.row.zone == level.zone) {
                levels[i].push(level);
            }
        }
        let first = zones.iter().map(|z| z.row.first_spp).min().unwrap_or(1) as f64;
        let last = zones.iter().map(|z| z.row.last_spp).max().unwrap_or(1) as f64;
        let noises = levels.iter().map(|of_zone| Noise::of(of_zone)).collect::<Option<Vec<_>>>();
        let noises = noises.ok_or_else(|| LabError::TooFewImages { scene: scene.to_owned() })?;
        let batch = |(turn, samples): (usize, u64)| -> Batch {
            (samples, noises.par_iter().map(|noise| noise.batch(turn, samples)).collect())
        };
        let stages = stages(first, BEYOND * last).into_iter().enumerate();
        let stages = stages.map(|(i, [a, b])| vec![batch((2 * i, a)), batch((2 * i + 1, b))]).collect();
        let columns = (zones.len() as f64).sqrt().ceil() as usize;
        let tiles: Vec<&[Rgb]> = noises.iter().map(|noise| noise.converged.as_slice()).collect();
        let converged = mosaic(&tiles, edge, columns);
        Ok(Self { zones, edge, stages, converged })
    }

    /// Has a criterion judge every stage. For each zone, the least constant that would have stopped it
    /// there, stage by stage: what its verdicts tell, or 0 where it stops it, if it is one that stops.
    pub(super) fn follow(
        &self,
        criterion: Box<dyn StoppingCriterion + Send>,
        viewing: Viewing,
        stops: bool,
    ) -> Result<Vec<Vec<f64>>, LabError> {
        let size = (self.converged.width, self.converged.height);
        let params = Params::default()
            .with_tile(self.edge)
            .with_tone_mapping(ToneMapping::Srgb { exposure: 1.0 })
            .with_viewing(viewing)
            // At every stage: each brings more than a step.
            .with_schedule(Schedule::Every { step: 2 })
            .with_max_spp(u64::from(u32::MAX))
            // A criterion that tells is asked at every stage.
            .with_consecutive(if stops { 1 } else { u32::MAX });
        let against_converged = criterion.needs().reference;
        let mut session = Session::new(size.0, size.1, criterion, params)?;
        if against_converged {
            session.set_reference(self.converged.clone())?;
        }
        // Places of the picture that no zone fills.
        for tile in self.zones.len()..session.film().grid().len() {
            session.close(tile, Interruption::Cancelled);
        }
        let mut needed = vec![Vec::new(); self.zones.len()];
        for batches in &self.stages {
            for (samples, batch) in batches {
                for (tile, mean) in batch.iter().enumerate() {
                    if session.is_open(tile) {
                        session.push(tile, *samples, mean)?;
                    }
                }
            }
            session.judge()?;
            for (tile, needed) in needed.iter_mut().enumerate() {
                let told = session.verdict(tile).and_then(|v| v.probability).map(|p| 1.0 - f64::from(p));
                needed.push(match (stops, session.is_open(tile)) {
                    (true, true) => f64::INFINITY,
                    (true, false) => 0.0,
                    (false, _) => told.unwrap_or(f64::INFINITY),
                });
            }
        }
        Ok(needed)
    }

    /// Samples at which a constant stops each zone: between the first stage that it is enough for and the
    /// one before, as those of a picture that differs from people's last one as strongly as the noise of that
    /// stage, and within what observers could choose.
    pub(super) fn stops(&self, needed: &[Vec<f64>], constant: f64) -> Vec<f64> {
        let totals: Vec<u64> = self
            .stages
            .iter()
            .scan(0, |total, batches| {
                *total += batches.iter().map(|(samples, _)| samples).sum::<u64>();
                Some(*total)
            })
            .collect();
        let stop = |(zone, needed): (&JudgedZone, &Vec<f64>)| {
            let (first, last) = (zone.row.first_spp as f64, zone.row.last_spp as f64);
            let stage = needed.iter().position(|least| *least <= constant);
            let between = |stage: usize| ((totals[stage.saturating_sub(1)] * totals[stage]) as f64).sqrt();
            as_difference(stage.map_or(f64::INFINITY, between), zone.reference_spp()).clamp(first, last)
        };
        self.zones.iter().zip(needed).map(stop).collect()
    }
}

/// Squares side by side; empty places are black.
fn mosaic(tiles: &[&[Rgb]], edge: usize, columns: usize) -> Reference {
    let (width, height) = (columns * edge, tiles.len().div_ceil(columns) * edge);
    let mut pixels = vec![[0.0; 3]; width * height];
    for (i, tile) in tiles.iter().enumerate() {
        for (y, row) in tile.chunks(edge).enumerate() {
            let start = (i / columns * edge + y) * width + i % columns * edge;
            pixels[start..start + row.len()].copy_from_slice(row);
        }
    }
    Reference::new((width, height), pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mosaic_is_in_the_order_of_its_tiles() {
        let [a, b, c] = [1.0f32, 2.0, 3.0].map(|v| vec![[v; 3]; 4]);
        let picture = mosaic(&[&a, &b, &c], 2, 2);
        assert_eq!((picture.width, picture.height), (4, 4));
        let red: Vec<f32> = picture.pixels.iter().map(|p| p[0]).collect();
        assert_eq!(red, [1., 1., 2., 2., 1., 1., 2., 2., 3., 3., 0., 0., 3., 3., 0., 0.]);
    }
}
