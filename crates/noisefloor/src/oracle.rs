//! The oracle: a trained model as a stopping criterion.

use crate::criterion::{CriterionError, Needs, StoppingCriterion, Verdict, View};
use crate::descriptor::DescriptorError;
use crate::evidence::{Evidence, TilePlanes};
use crate::model::Model;
use crate::tile::Tile;
use rayon::prelude::*;
use thiserror::Error;

/// P at which two pictures count as identical (Takouachet et al. 2017, §4.4).
pub const DEFAULT_THRESHOLD: f32 = 0.9;

/// A probability threshold outside (0, 1).
#[derive(Debug, Error, Clone, Copy, PartialEq)]
#[error("the probability threshold must lie between 0 and 1, not {0}")]
pub struct ThresholdError(pub f32);

/// Judges tiles by a trained model.
#[derive(Clone, Debug)]
pub struct Oracle {
    model: Model,
    threshold: f32,
}

impl Oracle {
    /// An oracle that calls a tile converged where P ≥ `threshold`.
    ///
    /// # Errors
    /// [`ThresholdError`] unless 0 < `threshold` < 1.
    pub fn new(model: Model, threshold: f32) -> Result<Self, ThresholdError> {
        if threshold > 0.0 && threshold < 1.0 {
            Ok(Self { model, threshold })
        } else {
            Err(ThresholdError(threshold))
        }
    }

    /// The bundled model at P ≥ 0.9.
    #[cfg(feature = "bundled-model")]
    pub fn bundled() -> Self {
        Self { model: Model::bundled(), threshold: DEFAULT_THRESHOLD }
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// P from which a tile counts as converged.
    pub fn threshold(&self) -> f32 {
        self.threshold
    }

    /// Judges one tile by its planes, which have `samples` samples per pixel.
    ///
    /// # Errors
    /// [`CriterionError::TileSize`] if the model is for tiles of another size.
    pub fn judge_planes(&self, planes: &TilePlanes, samples: u64) -> Result<Verdict, CriterionError> {
        let mut raw = Vec::with_capacity(self.model.descriptor.len());
        self.model.descriptor.describe(planes, &mut raw).map_err(|e| self.misfit(e))?;
        let mut scaled = raw.clone();
        let probability = self.model.probability(&mut scaled);
        let converged = probability >= self.threshold;
        let expected_samples =
            if converged { Some(samples) } else { self.expect(&raw, &mut scaled, samples) };
        Ok(Verdict { converged, probability: Some(probability), expected_samples })
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
        }
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let judge = |&tile: &Tile| {
            let planes = match self.model.evidence {
                Evidence::Halves => TilePlanes::from_halves(view.film, view.display, tile),
                Evidence::Reference => {
                    let reference = view.reference.ok_or_else(|| CriterionError::NoReference(self.name()))?;
                    TilePlanes::from_reference(view.film, view.display, reference, tile)
                }
            };
            self.judge_planes(&planes, view.film.samples(tile.index))
        };
        tiles.par_iter().map(judge).collect()
    }
}
