//! ColorVideoVDP, by `noisefloor-vision`.

use crate::picture::{DifferenceMap, DisplayPixels, MetricError};
use noisefloor::{Rgb, Tile, TileGrid};
use noisefloor_vision::{Viewing, VisionModel, VisionWorkspace};
use rayon::prelude::*;

/// Tiles are compared with at least this many pixels on each side, where the picture has them.
const LEAST_EDGE: usize = 16;

/// ColorVideoVDP for still pictures (Mantiuk et al. 2024), equal to the PyPI package `cvvdp` 0.5.7: the
/// quality of `test` in just-objectionable differences (JOD), and at each pixel the JODs that it loses there.
///
/// 10 JOD is no visible difference; at 9, three of four people prefer the reference. Display values go to the
/// display of `viewing` as code values.
///
/// # Errors
/// [`MetricError`] if sizes do not match, an edge is below 2 pixels, or a value is not finite.
pub fn cvvdp(
    reference: &[Rgb],
    test: &[Rgb],
    width: usize,
    height: usize,
    viewing: &Viewing,
) -> Result<(f64, DifferenceMap), MetricError> {
    for pixels in [reference, test] {
        DisplayPixels::new(width, height, pixels)?;
    }
    let (model, mut workspace) = (VisionModel::new(viewing), VisionWorkspace::default());
    let mut found = model.compare(test, reference, (width, height), &mut workspace)?;
    Ok((found.jod(), DifferenceMap { width, height, values: found.map().to_vec() }))
}

/// [`cvvdp`] of single tiles, each compared as a picture of its own: JODs, in the order of `tiles`. Tiles of
/// fewer than 16 pixels on a side, as at the border of a picture, take pixels of their neighbours in.
pub fn cvvdp_of_tiles(
    reference: &[Rgb],
    test: &[Rgb],
    grid: TileGrid,
    tiles: &[Tile],
    model: &VisionModel,
) -> Result<Vec<f64>, MetricError> {
    let (width, height) = grid.size();
    for pixels in [reference, test] {
        DisplayPixels::new(width, height, pixels)?;
    }
    let jod = |workspace: &mut VisionWorkspace, tile: &Tile| {
        let (x0, columns) = widened(tile.x, tile.width, width);
        let (y0, rows) = widened(tile.y, tile.height, height);
        // A picture of a single row or column stands beside itself
        let place = |i: usize| (y0 + i / columns).min(height - 1) * width + (x0 + i % columns).min(width - 1);
        let crop = |of: &[Rgb]| (0..rows * columns).map(|i| of[place(i)]).collect::<Vec<Rgb>>();
        Ok(model.compare(&crop(test), &crop(reference), (columns, rows), workspace)?.jod())
    };
    tiles.par_iter().map_init(VisionWorkspace::default, jod).collect()
}

/// First pixel and number of pixels of a stretch that has at least [`LEAST_EDGE`] of `all`, and never less
/// than two.
fn widened(start: usize, length: usize, all: usize) -> (usize, usize) {
    let wanted = length.max(LEAST_EDGE).min(all);
    (start.min(all - wanted), wanted.max(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_are_pictures_of_their_own() {
        let value = |i: usize, noise: f32| [0.3 + (i % 7) as f32 * noise; 3];
        let reference: Vec<Rgb> = (0..48 * 33).map(|i| value(i, 0.0)).collect();
        let test: Vec<Rgb> = (0..48 * 33).map(|i| value(i, if i % 48 >= 32 { 0.01 } else { 0.0 })).collect();
        let (grid, viewing) = (TileGrid::new(48, 33, 16).unwrap(), Viewing::default());
        let tiles: Vec<Tile> = grid.tiles().collect();
        let jods = cvvdp_of_tiles(&reference, &test, grid, &tiles, &VisionModel::new(&viewing)).unwrap();
        for (tile, &jod) in tiles.iter().zip(&jods) {
            assert_eq!(jod < 9.99, tile.x >= 32, "{tile:?}: {jod}");
        }
        // A whole tile is what `cvvdp` makes of its pixels
        let crop = |of: &[Rgb]| (0..256).map(|i| of[i / 16 * 48 + 32 + i % 16]).collect::<Vec<_>>();
        let (alone, _) = cvvdp(&crop(&reference), &crop(&test), 16, 16, &viewing).unwrap();
        assert_eq!(jods[2], alone);
    }

    #[test]
    fn narrow_tiles_are_widened() {
        assert_eq!(
            [widened(0, 128, 500), widened(496, 4, 500), widened(0, 4, 4)],
            [(0, 128), (484, 16), (0, 4)]
        );
        assert_eq!(widened(0, 1, 1), (0, 2));
        let grid = TileGrid::new(1, 40, 16).unwrap();
        let tiles: Vec<Tile> = grid.tiles().collect();
        let model = VisionModel::new(&Viewing::default());
        let jods = cvvdp_of_tiles(&[[0.5; 3]; 40], &[[0.5; 3]; 40], grid, &tiles, &model).unwrap();
        assert!(jods.len() == tiles.len() && jods.iter().all(|&jod| jod > 9.999), "{jods:?}");
    }

    #[test]
    fn what_does_not_fit_is_an_error() {
        let (grey, viewing) = (vec![[0.5; 3]; 64], Viewing::default());
        assert!(matches!(cvvdp(&grey, &grey, 8, 9, &viewing), Err(MetricError::Pixels { .. })));
        assert!(matches!(cvvdp(&grey[..8], &grey[..8], 8, 1, &viewing), Err(MetricError::Vision(_))));
        let odd = vec![[f32::NAN; 3]; 64];
        assert!(matches!(cvvdp(&grey, &odd, 8, 8, &viewing), Err(MetricError::Vision(_))));
    }
}
