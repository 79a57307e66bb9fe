//! How far two denoised pictures of one view are from what their mean may have lost: for the search for a renderer's setting.

use crate::estimate::{DenoisedError, DenoisedHalves, ESTIMATE_ERRS_BY};
use crate::unmet::jods_lost_unmet;
use noisefloor::tune::{Looked, PairError, PicturePair, PixelCounts};
use noisefloor::{Film, Params, Rgb, Tile, Viewing};
use noisefloor_vision::{VisionError, VisionModel, VisionWorkspace};
use rayon::prelude::*;

impl DenoisedError {
    /// Looks at two pictures of which a denoiser made these, each without a look at the other: how far the worst of their
    /// squares is from having lost `lost` JODs, with the margin of [`ESTIMATE_ERRS_BY`]: where the ratio is 1, two thirds of
    /// that are estimated. Or, if that is more, from losing as much by light that it is likely to lack ([`jods_lost_unmet`]).
    /// [`DenoisedError::map_of_jods_lost`] makes the map. `counts` are as for [`PicturePair::look`].
    ///
    /// # Errors
    /// [`PairError`]; as [`PairError::Judge`] if there are more or fewer pixels than in the pair, or the picture is larger than the
    /// vision model compares.
    pub fn look(
        pair: &PicturePair,
        denoised: [&[Rgb]; 2],
        lost: f64,
        params: &Params,
        counts: Option<[&PixelCounts; 2]>,
    ) -> Result<(Self, Looked), PairError> {
        let halves = DenoisedHalves { size: pair.size(), noisy: pair.halves(), denoised };
        let mut estimated = None;
        let looked = pair.look_by(params, counts, |display, film| {
            let error = Self::new(&halves, display).map_err(|error| PairError::Judge(error.into()))?;
            let squares = error.lost_in(pair.squares(), film, lost, &params.viewing);
            estimated = Some(error);
            squares.map_err(|error| PairError::Judge(error.into()))
        })?;
        let error = estimated.ok_or(PairError::NoMap)?;
        Ok((error, looked))
    }

    /// What each square may have lost, over what it may lose.
    fn lost_in(
        &self,
        squares: Vec<Tile>,
        film: &Film,
        lost: f64,
        viewing: &Viewing,
    ) -> Result<Vec<(Tile, f64)>, VisionError> {
        let eyes = VisionModel::new(viewing);
        let unmet = jods_lost_unmet(film, self.display(), viewing);
        let ratio = |room: &mut VisionWorkspace, square: Tile| {
            let estimated = self.jods_lost(Tile { index: 0, ..square }, &eyes, room)?;
            let unmet = unmet.iter().filter(|(tile, ..)| overlap(tile, &square)).map(|(_, lost, _)| *lost);
            Ok((square, unmet.fold(estimated * ESTIMATE_ERRS_BY, f64::max) / lost))
        };
        squares.into_par_iter().map_init(VisionWorkspace::default, ratio).collect()
    }
}

fn overlap(a: &Tile, b: &Tile) -> bool {
    let meet = |a: usize, length: usize, b: usize, other: usize| a < b + other && b < a + length;
    meet(a.x, a.width, b.x, b.width) && meet(a.y, a.height, b.y, b.height)
}
