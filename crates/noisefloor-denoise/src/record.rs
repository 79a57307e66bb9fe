//! What is known of the verdicts on denoised pictures besides the verdicts.

use crate::estimate::{DenoisedError, PartError};
use crate::parts::holds;
use noisefloor::{Rgb, Tile, TileGrid};

/// What the last verdicts looked at, for reports.
#[derive(Clone, Debug, Default)]
pub struct DenoisedRecord {
    /// The error of the denoised picture when each tile was last judged.
    pub error: Option<DenoisedError>,
    /// For each tile, the just-objectionable differences lost when it was last judged, by a small tile those of the square
    /// around it where these are fewer; NaN before that.
    pub jods_lost: Vec<f64>,
    /// Tiles to be shown as rendered: their noise has lost no more than is allowed, and what the denoiser makes of them has.
    pub undenoised: Vec<bool>,
    /// Seconds spent on denoising and on the estimates from it.
    pub seconds: f64,
    /// Verdicts so far: each takes two denoisings.
    pub verdicts: usize,
}

impl DenoisedRecord {
    /// Makes of the denoised picture the one to be shown, row-major: tiles that are [`undenoised`](Self::undenoised) become as
    /// they were rendered.
    pub fn compose(&self, grid: TileGrid, rendered: &[Rgb], denoised: &mut [Rgb]) {
        let tiles = grid.tiles().filter(|tile| self.undenoised.get(tile.index) == Some(&true));
        for row in tiles.flat_map(|tile| tile.rows(grid.width())) {
            if let (Some(to), Some(from)) = (denoised.get_mut(row.clone()), rendered.get(row)) {
                to.copy_from_slice(from);
            }
        }
    }

    /// Takes over what is known of a rectangle of the picture, where these tiles are.
    pub(crate) fn renew(&mut self, (part, newer): PartError, tiles: &[Tile]) {
        match &mut self.error {
            Some(error) if error.size() != newer.size() => {
                let judged = tiles.iter().filter(|&&tile| holds(part, tile));
                judged.for_each(|&tile| error.renew(tile, &newer, part));
            }
            error => *error = Some(newer),
        }
    }

    /// Everything but the error picture: the number of verdicts, the seconds, then the loss of each tile, in eight
    /// bytes each, little-endian, and whether it is shown as rendered, in one.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(16 + 9 * self.jods_lost.len());
        bytes.extend((self.verdicts as u64).to_le_bytes());
        bytes.extend(self.seconds.to_le_bytes());
        self.jods_lost.iter().for_each(|lost| bytes.extend(lost.to_le_bytes()));
        bytes.extend(self.undenoised.iter().map(|&undenoised| u8::from(undenoised)));
        bytes
    }

    /// What [`DenoisedRecord::to_bytes`] returned for so many tiles; `None` if it did not.
    pub(crate) fn from_bytes(tiles: usize, bytes: &[u8]) -> Option<Self> {
        let (&verdicts, rest) = bytes.split_first_chunk::<8>()?;
        let (&seconds, rest) = rest.split_first_chunk::<8>()?;
        let (verdicts, seconds) = (u64::from_le_bytes(verdicts), f64::from_le_bytes(seconds));
        // Before the first verdict there are no tiles
        let expected = if verdicts == 0 { 0 } else { tiles };
        let (lost, undenoised) = rest.split_at_checked(8 * expected)?;
        let flags = undenoised.len() == expected && undenoised.iter().all(|&flag| flag <= 1);
        if !(flags && seconds >= 0.0 && seconds.is_finite()) {
            return None;
        }
        let jods_lost = lost.as_chunks().0.iter().map(|lost| f64::from_le_bytes(*lost)).collect();
        let undenoised = undenoised.iter().map(|&flag| flag == 1).collect();
        let verdicts = usize::try_from(verdicts).ok()?;
        Some(Self { error: None, jods_lost, undenoised, seconds, verdicts })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_restored_and_nothing_else_is() {
        let undenoised = vec![false, true];
        let record =
            DenoisedRecord { jods_lost: vec![0.25, 0.5], undenoised, seconds: 1.5, verdicts: 3, error: None };
        let bytes = record.to_bytes();
        let again = DenoisedRecord::from_bytes(2, &bytes).unwrap();
        assert_eq!((again.jods_lost, again.undenoised), (record.jods_lost, record.undenoised));
        assert_eq!((again.seconds, again.verdicts), (1.5, 3));
        assert!(DenoisedRecord::from_bytes(2, &DenoisedRecord::default().to_bytes()).is_some());
        for length in 0..bytes.len() {
            assert!(DenoisedRecord::from_bytes(2, &bytes[..length]).is_none(), "{length}");
        }
        assert!(DenoisedRecord::from_bytes(3, &bytes).is_none());
        let mut odd = bytes.clone();
        *odd.last_mut().unwrap() = 2;
        assert!(DenoisedRecord::from_bytes(2, &odd).is_none());
        let mut odd = bytes;
        odd[8..16].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(DenoisedRecord::from_bytes(2, &odd).is_none());
    }
}
