//! The pairs as rows, and what is known of each.

use super::gram::squared_distances;
use crate::error::LabError;
use ndarray::Array2;
use noisefloor::svm::Scaler;
use noisefloor_learn::{Level, Origin, Table};
use serde::{Deserialize, Serialize};

/// What is written into the rows. The paper does not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PairScaling {
    /// Display values, white at 1.
    Display,
    /// Each number with mean 0 and standard deviation 1 over all synthesised pairs.
    Standardised,
}

impl PairScaling {
    /// In the order in which [`Pairs::scale`] can get from one to the next.
    pub(super) const ALL: [Self; 2] = [Self::Display, Self::Standardised];

    /// For files and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Display => "display",
            Self::Standardised => "standardised",
        }
    }
}

/// What is known of a pair.
pub(super) struct Pair {
    /// Row of its reference.
    pub(super) zone: usize,
    pub(super) group: String,
    pub(super) converged: bool,
}

/// Pairs as they come from the corpora.
pub(super) struct Loaded {
    pub(super) digest: String,
    pub(super) table: Table,
}

/// Pairs as rows of matrices: synthesised ones first, then real ones. A row of numbers is that of the tile,
/// then that of its reference, which all pairs of a zone share.
pub(super) struct Pairs {
    pub(super) tiles: Array2<f32>,
    pub(super) references: Array2<f32>,
    pub(super) known: Vec<Pair>,
    pub(super) synthesised: usize,
    scaling: PairScaling,
}

impl Loaded {
    /// Of a censored zone only the levels below its threshold are certain.
    pub(super) fn into_pairs(mut self) -> Result<Pairs, LabError> {
        let groups = self.table.groups();
        if groups.len() < 3 {
            let (found, names) = (groups.len(), groups.join(", "));
            return Err(LabError::TooFewGroups { found, names });
        }
        let half = self.table.descriptor.dimensions() / 2;
        let (mut tiles, mut known, mut synthesised) = (Vec::new(), Vec::new(), 0);
        let mut references = Array2::zeros((self.table.zones.len(), half));
        for origin in [Origin::Synthesised, Origin::Real] {
            for (zone, of_zone) in self.table.zones.iter_mut().enumerate() {
                let certain = |level: &Level| !of_zone.censored || level.spp < of_zone.human_spp;
                for level in of_zone.levels.iter_mut().filter(|l| l.origin == origin && certain(l)) {
                    // Taken, not copied: all pairs together are large.
                    let numbers = std::mem::take(&mut level.descriptor);
                    tiles.extend_from_slice(&numbers[..half]);
                    references
                        .row_mut(zone)
                        .iter_mut()
                        .zip(&numbers[half..])
                        .for_each(|(to, from)| *to = *from);
                    let converged = level.spp >= of_zone.human_spp;
                    known.push(Pair { zone, group: of_zone.group.clone(), converged });
                }
            }
            if origin == Origin::Synthesised {
                synthesised = known.len();
            }
        }
        let tiles = matrix((known.len(), half), tiles);
        Ok(Pairs { tiles, references, known, synthesised, scaling: PairScaling::Display })
    }
}

impl Pairs {
    /// Brings the numbers from display values to `scaling`, if they are not there yet.
    pub(super) fn scale(&mut self, scaling: PairScaling) {
        if (self.scaling, scaling) == (PairScaling::Display, PairScaling::Standardised) {
            let learned = self.known[..self.synthesised].iter().map(|p| p.zone);
            standardise(&mut self.tiles, 0..self.synthesised);
            standardise(&mut self.references, learned);
            self.scaling = scaling;
        }
    }

    /// All numbers of a pair.
    pub(super) fn row(&self, i: usize) -> Vec<f32> {
        self.tiles.row(i).iter().chain(self.references.row(self.known[i].zone)).copied().collect()
    }

    /// ‖x − y‖² of all pairs: that of the tiles and that of the references.
    pub(super) fn squared_distances(&self, on_block: impl Fn(usize, usize) + Sync) -> Array2<f64> {
        let mut squared = squared_distances(self.tiles.view(), on_block);
        let references = squared_distances(self.references.view(), |_, _| ());
        for (mut row, one) in squared.rows_mut().into_iter().zip(&self.known) {
            let between = references.row(one.zone);
            row.iter_mut().zip(&self.known).for_each(|(to, other)| *to += between[other.zone]);
        }
        squared
    }

    /// Names of the groups, sorted, each once.
    pub(super) fn groups(&self) -> Vec<&str> {
        let mut groups: Vec<&str> = self.known.iter().map(|p| p.group.as_str()).collect();
        groups.sort_unstable();
        groups.dedup();
        groups
    }
}

/// Rows of numbers as a matrix; `numbers` has as many as the shape says.
fn matrix((rows, columns): (usize, usize), numbers: Vec<f32>) -> Array2<f32> {
    debug_assert_eq!(numbers.len(), rows * columns);
    Array2::from_shape_vec((rows, columns), numbers).unwrap_or_default()
}

/// Each column with mean 0 and standard deviation 1 over the rows named.
fn standardise(rows: &mut Array2<f32>, over: impl Iterator<Item = usize> + Clone) {
    let scaler = Scaler::fit(over.map(|i| rows.row(i).to_slice().unwrap_or_default()), 0.0);
    for mut row in rows.rows_mut() {
        if let Some(row) = row.as_slice_mut() {
            scaler.apply(row);
        }
    }
}
