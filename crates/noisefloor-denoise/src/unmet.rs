//! Light that a denoised picture is likely to lack, because hardly any sample has met it: denoisers take lone finds for
//! noise, and remove them.

use crate::estimate::DenoisedError;
use noisefloor::{Film, Tile, Viewing, criterion::OpenFor, display::Display, unmet::Unmet};
use noisefloor_vision::{VisionModel, VisionWorkspace};
use rayon::prelude::*;

/// What would be wrong with a plain field as bright as the tile if the light fell on it that it is likely to lack; `None` if
/// that is nothing.
///
/// Nothing but the film counts: what the denoiser makes of tiles that have stopped is not known after a resume.
pub(crate) fn unmet_error(
    film: &Film,
    display: &Display,
    unmet: &Unmet,
    tile: Tile,
) -> Option<DenoisedError> {
    let light = unmet.shown(film, display, tile)?;
    let pixels = tile.rows(film.grid().width()).flatten().map(|pixel| film.pixel(tile.index, pixel));
    let sum = pixels.fold([0.0; 3], |sum, pixel| std::array::from_fn(|c| sum[c] + f64::from(pixel[c])));
    let field = display.luma(sum.map(|c| (c / tile.pixels() as f64) as f32));
    let light = light.residual.inside(light.inner).collect();
    Some(DenoisedError::of((tile.width, tile.height), vec![[vec![field; tile.pixels()], light]], display))
}

/// Just-objectionable differences (JOD) that each tile of a film would lose by the light that it is likely to lack, in their
/// order, with the tiles and what tells of it. The film keeps two halves; the formula is [`Unmet`]'s.
pub fn jods_lost_unmet(film: &Film, display: &Display, viewing: &Viewing) -> Vec<(Tile, f64, OpenFor)> {
    let (eyes, unmet) = (VisionModel::new(viewing), Unmet::of(film, display, *viewing));
    let tiles: Vec<Tile> = film.grid().tiles().collect();
    let lost = |room: &mut VisionWorkspace, &tile: &Tile| {
        let error = unmet_error(film, display, &unmet, tile);
        let lost = error.map_or(0.0, |error| error.jods_lost_at(1.0, &eyes, room).unwrap_or(10.0));
        (tile, lost, unmet.kind(film, tile))
    };
    tiles.par_iter().map_init(VisionWorkspace::default, lost).collect()
}
