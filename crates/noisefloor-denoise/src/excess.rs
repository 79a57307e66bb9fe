//! How far two denoised pictures of one view are from what their mean may have lost: for the search for a renderer's setting.

use crate::estimate::{DenoisedError, ESTIMATE_ERRS_BY};
use crate::unmet::jods_lost_unmet;
use noisefloor::tune::{Excess, squares};
use noisefloor::{Film, Tile, Viewing};
use noisefloor_vision::{VisionError, VisionModel, VisionWorkspace};
use rayon::prelude::*;

/// How far a denoised picture is from what it may have lost.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct DenoisedExcess {
    /// In its worst square.
    pub worst: Excess,
    /// In each of its [`squares`]: what may be lost there, with the margin, over what is allowed.
    pub squares: Vec<(Tile, f64)>,
}

impl DenoisedError {
    /// How far the worst of the picture's [`squares`] is from having lost `lost` JODs, with the margin of
    /// [`ESTIMATE_ERRS_BY`]: where the ratio is 1, two thirds of that are estimated. Or, if that is more, from losing as much
    /// by light that it is likely to lack ([`jods_lost_unmet`]), which the two pictures tell as the halves of `film`.
    ///
    /// # Errors
    /// [`VisionError`] if the picture is larger than the vision model compares.
    pub fn excess(&self, film: &Film, lost: f64, viewing: &Viewing) -> Result<DenoisedExcess, VisionError> {
        let eyes = VisionModel::new(viewing);
        let unmet = jods_lost_unmet(film, self.display(), viewing);
        let ratio = |room: &mut VisionWorkspace, square: Tile| {
            let estimated = self.jods_lost(Tile { index: 0, ..square }, &eyes, room)?;
            let unmet = unmet.iter().filter(|(tile, _)| overlap(tile, &square)).map(|(_, lost)| *lost);
            Ok((square, unmet.fold(estimated * ESTIMATE_ERRS_BY, f64::max) / lost))
        };
        let all = squares(self.size()).into_par_iter().map_init(VisionWorkspace::default, ratio);
        let squares: Vec<(Tile, f64)> = all.collect::<Result<_, _>>()?;
        let worst = squares.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let (ratio, place) = worst.map_or((0.0, None), |(square, ratio)| {
            (*ratio, Some((square.x + square.width / 2, square.y + square.height / 2)))
        });
        let worst = Excess::new(ratio).at(place);
        Ok(DenoisedExcess { worst, squares })
    }
}

fn overlap(a: &Tile, b: &Tile) -> bool {
    let meet = |a: usize, length: usize, b: usize, other: usize| a < b + other && b < a + length;
    meet(a.x, a.width, b.x, b.width) && meet(a.y, a.height, b.y, b.height)
}
