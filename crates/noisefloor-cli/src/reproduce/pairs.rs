//! The pairs as rows, and what is known of each.

use anyhow::bail;
use ndarray::Array2;
use noisefloor::Scaler;
use noisefloor::evaluation::{Level, Origin, Table};
use serde::{Deserialize, Serialize};

/// What is written into the rows. The paper does not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scaling {
    /// Display values, white at 1.
    Display,
    /// Each number with mean 0 and standard deviation 1 over all synthesised pairs.
    Standardised,
}

impl Scaling {
    /// In the order in which [`Pairs::scale`] can get from one to the next.
    pub const ALL: [Self; 2] = [Self::Display, Self::Standardised];

    pub fn name(self) -> &'static str {
        match self {
            Self::Display => "display",
            Self::Standardised => "standardised",
        }
    }
}

/// What is known of a pair.
pub struct Pair {
    pub group: String,
    pub converged: bool,
}

/// Pairs as they come from the corpora.
pub struct Loaded {
    pub digest: String,
    pub table: Table,
}

/// Pairs as rows of a matrix: synthesised ones first, then real ones.
pub struct Pairs {
    pub rows: Array2<f32>,
    pub known: Vec<Pair>,
    /// How many are synthesised.
    pub synthesised: usize,
    scaling: Scaling,
}

impl Loaded {
    /// Of a censored zone only the levels below its threshold are certain.
    pub fn into_pairs(mut self) -> anyhow::Result<Pairs> {
        let dimensions = self.table.descriptor.len();
        let (mut numbers, mut known, mut synthesised) = (Vec::new(), Vec::new(), 0);
        for origin in [Origin::Synthesised, Origin::Real] {
            for zone in &mut self.table.zones {
                let certain = |level: &Level| !zone.censored || level.spp < zone.human_spp;
                for level in zone.levels.iter_mut().filter(|l| l.origin == origin && certain(l)) {
                    // Moved, not copied: all pairs are gigabytes.
                    numbers.append(&mut level.descriptor);
                    let converged = level.spp >= zone.human_spp;
                    known.push(Pair { group: zone.group.clone(), converged });
                }
            }
            if origin == Origin::Synthesised {
                synthesised = known.len();
            }
        }
        let groups = self.table.groups();
        if groups.len() < 3 {
            bail!(
                "leaving scenes out needs at least 3 groups of scenes; the corpus has {}: {}",
                groups.len(),
                groups.join(", ")
            );
        }
        let rows = Array2::from_shape_vec((known.len(), dimensions), numbers)?;
        Ok(Pairs { rows, known, synthesised, scaling: Scaling::Display })
    }
}

impl Pairs {
    /// Brings the rows from display values to `scaling`, if they are not there yet.
    pub fn scale(&mut self, scaling: Scaling) {
        if (self.scaling, scaling) == (Scaling::Display, Scaling::Standardised) {
            let learned = self.rows.rows().into_iter().take(self.synthesised);
            let scaler = Scaler::fit(learned.map(|r| r.to_slice().unwrap_or_default()));
            for mut row in self.rows.rows_mut() {
                if let Some(row) = row.as_slice_mut() {
                    scaler.apply(row);
                }
            }
            self.scaling = scaling;
        }
    }

    /// Names of the groups, sorted, each once.
    pub fn groups(&self) -> Vec<&str> {
        let mut groups: Vec<&str> = self.known.iter().map(|p| p.group.as_str()).collect();
        groups.sort_unstable();
        groups.dedup();
        groups
    }
}
