//! What one person said of one tile.

use noisefloor::{Model, People};
use serde::{Deserialize, Serialize};

/// One person's answer about a tile at one number of samples. A threshold seen from one side: above `spp` if
/// noise is seen, at or below it if none is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// Pictures of one group show the same room, and are left out together, also with zones of a group of
    /// that name.
    pub group: String,
    /// Samples per pixel, above 0.
    pub spp: f64,
    /// The raw descriptor, as long as the table's.
    pub descriptor: Vec<f32>,
    pub sees_noise: bool,
}

impl Answer {
    /// P of the tile, in [0, 1].
    ///
    /// # Panics
    /// If the descriptor does not have the model's dimensionality.
    pub fn probability(&self, model: &Model) -> f32 {
        model.judge(&self.descriptor).probability
    }

    /// Whether a verdict for that share of `people` says the same.
    pub fn agrees(&self, probability: f32, people: People) -> bool {
        people.are_satisfied_by(probability) != self.sees_noise
    }
}
