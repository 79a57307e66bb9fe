//! What is kept of the verdicts on denoised pictures.

use crate::estimate::PartError;
use crate::parts::{holds, within};
use noisefloor::{Rgb, Session, StoppingCriterion, Tile, TileGrid};
use noisefloor_vision::VisionModel;
use rayon::prelude::*;

/// What is kept from one verdict to the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Record {
    /// Tiles that satisfied the last verdict on them, by index.
    pub done: Vec<Option<Done>>,
    /// Just-objectionable differences (JOD) lost at each pixel when its tile was last judged, row-major; NaN where none was.
    pub map: Vec<f32>,
}

/// A tile that satisfied its last verdict.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Done {
    /// Just-objectionable differences (JOD) that it had lost.
    pub lost: f64,
    /// Whether it is shown as rendered.
    pub undenoised: bool,
    /// Samples per pixel that it had when it was first satisfied: since then, all verdicts on it were.
    pub spp: u64,
}

/// Bytes of what is kept of a tile.
const DONE_BYTES: usize = 17;

impl Done {
    /// A byte, 0 for an open tile, 1 for one that is done, 2 for one that is done as rendered; and eight each for what it has
    /// lost and its samples, little-endian.
    pub(crate) fn to_bytes(done: Option<Self>) -> [u8; DONE_BYTES] {
        let kind = done.map_or(0, |done| 1 + u8::from(done.undenoised));
        let (lost, spp) = done.map_or((0.0, 0), |done| (done.lost, done.spp));
        let mut bytes = [kind; DONE_BYTES];
        bytes[1..9].copy_from_slice(&lost.to_le_bytes());
        bytes[9..].copy_from_slice(&spp.to_le_bytes());
        bytes
    }

    /// What [`Done::to_bytes`] returned, for each tile; `None` if it did not.
    pub(crate) fn all_from_bytes(bytes: &[u8]) -> Option<Vec<Option<Self>>> {
        let (tiles, rest) = bytes.as_chunks::<DONE_BYTES>();
        let tile = |bytes: &[u8; DONE_BYTES]| {
            let (&kind, rest) = bytes.split_first()?;
            let (&lost, spp) = rest.split_first_chunk::<8>()?;
            let (lost, spp) = (f64::from_le_bytes(lost), u64::from_le_bytes(spp.try_into().ok()?));
            match kind {
                0 if lost == 0.0 && spp == 0 => Some(None),
                1 | 2 if lost.is_finite() => Some(Some(Self { lost, undenoised: kind == 2, spp })),
                _ => None,
            }
        };
        if rest.is_empty() { tiles.iter().map(tile).collect() } else { None }
    }
}

/// Makes of the denoised picture of a session the one to be shown, row-major: tiles that are
/// [`undenoised`](noisefloor::Verdict::undenoised) become as they were rendered.
pub fn compose<C: StoppingCriterion>(session: &Session<C>, rendered: &[Rgb], denoised: &mut [Rgb]) {
    let grid = session.film().grid();
    let is_undenoised = |tile: &Tile| session.verdict(tile.index).is_some_and(|verdict| verdict.undenoised);
    for row in grid.tiles().filter(is_undenoised).flat_map(|tile| tile.rows(grid.width())) {
        if let (Some(to), Some(from)) = (denoised.get_mut(row.clone()), rendered.get(row)) {
            to.copy_from_slice(from);
        }
    }
}

impl Record {
    /// Of a picture that nothing is known of.
    pub(crate) fn new(grid: TileGrid) -> Self {
        Self { done: vec![None; grid.len()], map: vec![f32::NAN; grid.width() * grid.height()] }
    }

    /// Maps what is wrong with these tiles, each of which is in one of the parts.
    pub(crate) fn renew(&mut self, width: usize, parts: &[PartError], tiles: &[Tile], eyes: &VisionModel) {
        // A part that is too large to be compared stays as it was
        let mapped: Vec<_> = parts.par_iter().map(|(_, error)| error.map_of_jods_lost(eyes)).collect();
        for (&(part, _), map) in parts.iter().zip(mapped).filter_map(|(part, map)| Some((part, map.ok()?))) {
            for &tile in tiles.iter().filter(|&&tile| holds(part, tile)) {
                for (to, from) in tile.rows(width).zip(within(tile, part).rows(part.width)) {
                    self.map[to].copy_from_slice(&map[from]);
                }
            }
        }
    }

    /// Each tile as [`Done::to_bytes`], then the map, four bytes a pixel, little-endian.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let tiles = self.done.iter().flat_map(|&done| Done::to_bytes(done));
        tiles.chain(self.map.iter().flat_map(|lost| lost.to_le_bytes())).collect()
    }

    /// What [`Record::to_bytes`] returned for these tiles; `None` if it did not.
    pub(crate) fn from_bytes(grid: TileGrid, bytes: &[u8]) -> Option<Self> {
        let (tiles, map) = bytes.split_at_checked(DONE_BYTES * grid.len())?;
        let done = Done::all_from_bytes(tiles)?;
        let (map, rest) = map.as_chunks::<4>();
        let map: Vec<f32> = map.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
        let sound = rest.is_empty() && map.len() == grid.width() * grid.height();
        (sound && map.iter().all(|lost| lost.is_nan() || lost.is_finite())).then_some(Self { done, map })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_restored_and_nothing_else_is() {
        let grid = TileGrid::new(40, 20, 16).unwrap();
        let mut record = Record::new(grid);
        (record.done[1], record.map[7]) = (Some(Done { lost: 0.1, undenoised: false, spp: 48 }), 0.25);
        let bytes = record.to_bytes();
        let again = Record::from_bytes(grid, &bytes).unwrap();
        // Pixels that nothing is known of are NaN, which equals nothing
        assert_eq!((&again.done, again.to_bytes()), (&record.done, bytes.clone()));
        assert!(again.map[7] == 0.25 && again.map[8].is_nan());
        assert!((0..bytes.len()).all(|length| Record::from_bytes(grid, &bytes[..length]).is_none()));
        let mut odd = bytes;
        odd.splice(DONE_BYTES * grid.len()..DONE_BYTES * grid.len() + 4, f32::INFINITY.to_le_bytes());
        assert!(Record::from_bytes(grid, &odd).is_none());
    }

    #[test]
    fn so_are_tiles_that_are_done() {
        let done = |lost, undenoised, spp| Some(Done { lost, undenoised, spp });
        let tiles = [None, done(0.1, false, 48), done(0.0, true, u64::MAX), None];
        let bytes: Vec<u8> = tiles.into_iter().flat_map(Done::to_bytes).collect();
        assert_eq!(Done::all_from_bytes(&bytes).unwrap(), tiles);
        assert_eq!(Done::all_from_bytes(&[]).unwrap(), []);
        let tile =
            |kind: u8, lost: f64, spp: u64| [&[kind][..], &lost.to_le_bytes(), &spp.to_le_bytes()].concat();
        let spoiled = [
            &bytes[1..],
            &[&bytes[..], &[0]].concat(),
            &tile(3, 0.0, 0),
            &tile(1, f64::INFINITY, 0),
            &tile(0, 0.1, 0),
            &tile(0, 0.0, 1),
        ];
        for odd in spoiled {
            assert!(Done::all_from_bytes(odd).is_none(), "{odd:?}");
        }
    }
}
