//! What is kept of the verdicts on denoised pictures.

use crate::estimate::PartError;
use crate::parts::{holds, within};
use noisefloor::{Rgb, Session, StoppingCriterion, Tile, TileGrid};
use noisefloor_vision::VisionModel;
use rayon::prelude::*;

/// What people would see of what Open Image Denoise makes of a picture is n^−DENOISED_DECAY of n samples.
pub(crate) const DENOISED_DECAY: f64 = 0.38;
/// What an estimate says, what earlier ones of the tile said, and what the last ones of its neighbours did, as powers.
const OWN: f64 = 0.4;
const EARLIER: f64 = 0.3;
const NEIGHBOURS: f64 = 0.3;

/// What is kept from one verdict to the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Record {
    /// Tiles that satisfied the last verdict on them, or will without another, by index.
    pub done: Vec<Option<Done>>,
    /// The logarithm of what each tile would have lost after one sample per pixel, by all estimates of it; NaN before the first.
    at_one: Vec<f64>,
    /// The exposure under which the last verdict was given; 0 before it.
    pub exposure: f32,
    /// Just-objectionable differences (JOD) lost at each pixel when its tile was last judged, row-major; NaN where none was.
    pub map: Vec<f32>,
}

/// A tile that satisfied its last verdict, or does once it has so many samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Done {
    /// Just-objectionable differences (JOD) that it had lost, or will have.
    pub lost: f64,
    /// Whether it is shown as rendered.
    pub undenoised: bool,
    /// Samples per pixel that it had when it was first satisfied, since when all verdicts on it were; or that it needs.
    pub spp: u64,
    /// Whether it was told to go on, beside others or to where it is satisfied: what a verdict on it would say is known.
    pub ahead: bool,
}

/// Bytes of what is kept of a tile.
const DONE_BYTES: usize = 17;

impl Done {
    /// Just-objectionable differences (JOD) that it has lost after so many samples per pixel.
    pub(crate) fn lost_after(&self, spp: u64) -> f64 {
        self.lost * (self.spp as f64 / spp as f64).max(1.0).powf(DENOISED_DECAY)
    }

    /// A byte, 0 for an open tile, 1 for one that is done, 2 for one that is done as rendered, and two more if it goes on beside
    /// others; and eight each for what it has lost and its samples, little-endian.
    pub(crate) fn to_bytes(done: Option<Self>) -> [u8; DONE_BYTES] {
        let kind = done.map_or(0, |done| 1 + u8::from(done.undenoised) + 2 * u8::from(done.ahead));
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
                1..=4 if lost.is_finite() => {
                    Some(Some(Self { lost, undenoised: kind.is_multiple_of(2), spp, ahead: kind > 2 }))
                }
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
        Self {
            done: vec![None; grid.len()],
            at_one: vec![f64::NAN; grid.len()],
            exposure: 0.0,
            map: vec![f32::NAN; grid.width() * grid.height()],
        }
    }

    /// Whether a tile has been looked at.
    pub(crate) fn has_seen(&self, tile: Tile) -> bool {
        !self.at_one[tile.index].is_nan()
    }

    /// Takes in what estimates say that tiles have lost after so many samples per pixel. Returns what they say together with
    /// earlier ones and with those of the neighbours: most of what one estimate errs by is chance.
    pub(crate) fn pool(&mut self, grid: TileGrid, found: &[(Tile, u64, f64)]) -> Vec<f64> {
        let decay = |spp: u64| DENOISED_DECAY * (spp.max(1) as f64).ln();
        for &(tile, spp, lost) in found {
            let (new, old) = (lost.ln() + decay(spp), &mut self.at_one[tile.index]);
            *old = if old.is_nan() { new } else { (OWN * new + EARLIER * *old) / (OWN + EARLIER) };
        }
        let pooled = |&(tile, spp, _): &(Tile, u64, f64)| {
            let (own, around) = (self.at_one[tile.index], self.around(grid, tile));
            let mean = around.map_or(own, |around| (OWN + EARLIER) * own + NEIGHBOURS * around);
            (mean - decay(spp)).exp()
        };
        found.iter().map(pooled).collect()
    }

    /// The mean over those of the eight neighbours of a tile that something is known of.
    fn around(&self, grid: TileGrid, tile: Tile) -> Option<f64> {
        let (column, row) = (tile.index % grid.columns(), tile.index / grid.columns());
        let near = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
        let near = near(row, grid.rows())
            .flat_map(|y| near(column, grid.columns()).map(move |x| y * grid.columns() + x))
            .filter(|&index| index != tile.index && !self.at_one[index].is_nan());
        let (sum, count) = near.fold((0.0, 0), |(sum, count), index| (sum + self.at_one[index], count + 1));
        (count > 0).then(|| sum / f64::from(count))
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

    /// Each tile as [`Done::to_bytes`], then what each would have lost, eight bytes each, the exposure, and the map, four bytes a
    /// pixel, little-endian.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let tiles = self.done.iter().flat_map(|&done| Done::to_bytes(done));
        let tiles = tiles.chain(self.at_one.iter().flat_map(|lost| lost.to_le_bytes()));
        let singles = [self.exposure].into_iter().chain(self.map.iter().copied());
        tiles.chain(singles.flat_map(f32::to_le_bytes)).collect()
    }

    /// What [`Record::to_bytes`] returned for these tiles; `None` if it did not.
    pub(crate) fn from_bytes(grid: TileGrid, bytes: &[u8]) -> Option<Self> {
        let (tiles, rest) = bytes.split_at_checked(DONE_BYTES * grid.len())?;
        let done = Done::all_from_bytes(tiles)?;
        let (at_one, singles) = rest.split_at_checked(8 * grid.len())?;
        let at_one: Vec<f64> =
            at_one.as_chunks::<8>().0.iter().map(|&bytes| f64::from_le_bytes(bytes)).collect();
        let (singles, rest) = singles.as_chunks::<4>();
        let mut singles = singles.iter().map(|&bytes| f32::from_le_bytes(bytes));
        let (exposure, map): (f32, Vec<f32>) = (singles.next()?, singles.collect());
        let sound = rest.is_empty()
            && map.len() == grid.width() * grid.height()
            && at_one.iter().all(|lost| !lost.is_infinite())
            && exposure >= 0.0
            && map.iter().chain([&exposure]).all(|value| !value.is_infinite());
        sound.then_some(Self { done, at_one, exposure, map })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_restored_and_nothing_else_is() {
        let grid = TileGrid::new(40, 20, 16).unwrap();
        let mut record = Record::new(grid);
        record.done[1] = Some(Done { lost: 0.1, undenoised: false, spp: 48, ahead: true });
        (record.at_one[2], record.exposure, record.map[7]) = (-3.0, 0.5, 0.25);
        let bytes = record.to_bytes();
        let again = Record::from_bytes(grid, &bytes).unwrap();
        // Pixels that nothing is known of are NaN, which equals nothing
        assert_eq!((&again.done, again.to_bytes()), (&record.done, bytes.clone()));
        assert!(again.at_one[2] == -3.0 && again.exposure == 0.5 && again.map[7] == 0.25);
        assert!((0..bytes.len()).all(|length| Record::from_bytes(grid, &bytes[..length]).is_none()));
        let exposure = (DONE_BYTES + 8) * grid.len();
        for (at, value) in [(exposure - 4, f32::INFINITY), (exposure, -1.0), (exposure + 4, f32::INFINITY)] {
            // The upper half of an f64 that is infinite is that of an infinite f32, but for its exponent
            let value = if at < exposure { (f64::INFINITY.to_bits() >> 32) as u32 } else { value.to_bits() };
            let mut odd = bytes.clone();
            odd.splice(exposure - 8..exposure, 0.0_f64.to_le_bytes());
            odd.splice(at..at + 4, value.to_le_bytes());
            assert!(Record::from_bytes(grid, &odd).is_none(), "{at}");
        }
    }

    /// By hand: three tiles in a row that have lost 0.1, 0.2 and 0.4; then the first alone, after twice the samples.
    #[test]
    fn estimates_are_pooled_with_those_around_and_before() {
        let grid = TileGrid::new(48, 16, 16).unwrap();
        let at = |index: usize, spp: u64, lost: f64| (grid.tile(index), spp, lost);
        let pool = |order: [usize; 3]| {
            let mut record = Record::new(grid);
            let found = order.map(|index| at(index, 100, 0.1 * 2.0_f64.powi(index as i32)));
            (record.pool(grid, &found), record)
        };
        let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-12, "{a} and {b}");
        let (pooled, mut record) = pool([0, 1, 2]);
        // 0.1 · 2^0.3; 0.2, the geometric mean of both sides; 0.4 / 2^0.3
        [0.123_114_441_334_491_64, 0.2, 0.324_900_958_542_494_2]
            .into_iter()
            .zip(pooled)
            .for_each(|(right, found)| close(found, right));
        // 0.1^0.4 · (0.1/2^0.38)^0.3 · (0.2/2^0.38)^0.3
        close(record.pool(grid, &[at(0, 200, 0.1)])[0], 0.1051172909087706);
        // In whatever order tiles come
        let (turned, _) = pool([2, 0, 1]);
        close(turned[1], 0.123_114_441_334_491_64);
        // A tile without neighbours is itself
        let alone = TileGrid::new(16, 16, 16).unwrap();
        close(Record::new(alone).pool(alone, &[(alone.tile(0), 16, 0.3)])[0], 0.3);
    }

    #[test]
    fn so_are_tiles_that_are_done() {
        let done = |lost, undenoised, spp| Some(Done { lost, undenoised, spp, ahead: undenoised });
        let tiles = [None, done(0.1, false, 48), done(0.0, true, u64::MAX), None];
        let bytes: Vec<u8> = tiles.into_iter().flat_map(Done::to_bytes).collect();
        assert_eq!(Done::all_from_bytes(&bytes).unwrap(), tiles);
        assert_eq!(Done::all_from_bytes(&[]).unwrap(), []);
        let tile =
            |kind: u8, lost: f64, spp: u64| [&[kind][..], &lost.to_le_bytes(), &spp.to_le_bytes()].concat();
        let spoiled = [
            &bytes[1..],
            &[&bytes[..], &[0]].concat(),
            &tile(5, 0.0, 0),
            &tile(1, f64::INFINITY, 0),
            &tile(0, 0.1, 0),
            &tile(0, 0.0, 1),
        ];
        for odd in spoiled {
            assert!(Done::all_from_bytes(odd).is_none(), "{odd:?}");
        }
    }
}
