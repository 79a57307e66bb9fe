//! What is known of denoised pictures besides the verdicts on them.

use crate::estimate::{DenoisedError, PartError};
use crate::parts::holds;
use noisefloor::{Rgb, Session, StoppingCriterion, Tile};

/// What verdicts have looked at and have cost, for reports.
#[derive(Clone, Debug, Default)]
pub struct DenoisedRecord {
    /// The error of the denoised picture when each tile was last judged.
    pub error: Option<DenoisedError>,
    /// Seconds spent on denoising and on the estimates from it.
    pub seconds: f64,
    /// Verdicts so far: each takes two denoisings.
    pub verdicts: usize,
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

impl Done {
    /// A byte, 0 for an open tile, 1 for one that is done, 2 for one that is done as rendered; and eight each for what it has
    /// lost and its samples, little-endian.
    pub(crate) fn to_bytes(done: Option<Self>) -> [u8; 17] {
        let kind = done.map_or(0, |done| 1 + u8::from(done.undenoised));
        let (lost, spp) = done.map_or((0.0, 0), |done| (done.lost, done.spp));
        let mut bytes = [kind; 17];
        bytes[1..9].copy_from_slice(&lost.to_le_bytes());
        bytes[9..].copy_from_slice(&spp.to_le_bytes());
        bytes
    }

    /// What [`Done::to_bytes`] returned, for each tile; `None` if it did not.
    pub(crate) fn all_from_bytes(bytes: &[u8]) -> Option<Vec<Option<Self>>> {
        let (tiles, rest) = bytes.as_chunks::<17>();
        let tile = |bytes: &[u8; 17]| {
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

impl DenoisedRecord {
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

    /// Everything but the error picture: the number of verdicts, then the seconds, in eight bytes each, little-endian.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        [(self.verdicts as u64).to_le_bytes(), self.seconds.to_le_bytes()].concat()
    }

    /// What [`DenoisedRecord::to_bytes`] returned, and the bytes after it; `None` if it did not.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let (&verdicts, rest) = bytes.split_first_chunk::<8>()?;
        let (&seconds, rest) = rest.split_first_chunk::<8>()?;
        let seconds = f64::from_le_bytes(seconds);
        let verdicts = usize::try_from(u64::from_le_bytes(verdicts)).ok()?;
        let sound = seconds >= 0.0 && seconds.is_finite();
        sound.then_some((Self { error: None, seconds, verdicts }, rest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_restored_and_nothing_else_is() {
        let bytes = DenoisedRecord { seconds: 1.5, verdicts: 3, error: None }.to_bytes();
        let (again, rest) = DenoisedRecord::from_bytes(&bytes).unwrap();
        assert_eq!((again.seconds, again.verdicts, rest.len()), (1.5, 3, 0));
        for length in 0..bytes.len() {
            assert!(DenoisedRecord::from_bytes(&bytes[..length]).is_none(), "{length}");
        }
        let mut odd = bytes;
        odd[8..16].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(DenoisedRecord::from_bytes(&odd).is_none());
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
