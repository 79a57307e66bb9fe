//! A stack of pictures for a study, rendered in one go: each level continues the one before.

use crate::error::StudyError;
use noisefloor::{Film, ProgressiveSource, Request, Rgb, TileGrid};
use noisefloor_image::{RenderLayers, write_exr};
use std::path::Path;

/// Tile edge in which samples are asked for.
const EDGE: usize = 64;
/// Most samples per pixel asked for at once: a stop is possible in between.
const MOST_AT_ONCE: u64 = 64;

/// Renders `levels` (samples per pixel, increasing, from 1) into `folder` as `00064.exr` and so on, linear,
/// and makes the folder. What a level holds is what a render of that many samples holds. Between batches
/// `go_on` is told the level and the samples so far, and may stop it by returning false; the levels finished
/// by then are kept. `finish` sees each picture before it is written, and may denoise it; the last level, which
/// is the reference, is written as rendered.
pub fn render_stack(
    source: &mut (impl ProgressiveSource + ?Sized),
    levels: &[u64],
    folder: &Path,
    mut go_on: impl FnMut(u64, u64) -> bool,
    mut finish: impl FnMut(Vec<Rgb>) -> Result<Vec<Rgb>, StudyError>,
) -> Result<(), StudyError> {
    let bad = StudyError::Other;
    if levels.len() < 2 || levels[0] == 0 || !levels.is_sorted_by(|a, b| a < b) {
        return Err(bad(
            "a stack needs at least two levels, each with more samples than the one before".into()
        ));
    }
    std::fs::create_dir_all(folder).map_err(|fault| StudyError::at(folder, fault))?;
    let info = source.info();
    let grid = TileGrid::new(info.width, info.height, EDGE)
        .map_err(|source| StudyError::Tile { name: info.name.clone(), source })?;
    let mut film = Film::without_halves(grid);
    let mut have = 0;
    for &level in levels {
        while have < level {
            if !go_on(level, have) {
                return Ok(());
            }
            let spp = (level - have).min(MOST_AT_ONCE);
            let requests: Vec<Request> = grid.tiles().map(|tile| Request::new(tile, have, spp)).collect();
            let batches = source.sample(&requests).map_err(|e| bad(e.to_string()))?;
            for batch in batches {
                if batch.spp != spp {
                    let name = &info.name;
                    return Err(bad(format!(
                        "{name} gave {} of {spp} samples per pixel at {have}",
                        batch.spp
                    )));
                }
                film.add(batch.tile.index, batch.spp, &batch.mean).map_err(|e| bad(e.to_string()))?;
            }
            have += spp;
        }
        let reference = Some(&level) == levels.last();
        let pixels = if reference { film.image() } else { finish(film.image())? };
        let path = folder.join(format!("{level:05}.exr"));
        write_exr(&path, &RenderLayers::rgb(info.width, info.height, &pixels))?;
    }
    Ok(())
}
