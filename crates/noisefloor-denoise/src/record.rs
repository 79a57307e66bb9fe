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

    /// What [`DenoisedRecord::to_bytes`] returned; `None` if it did not.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (&verdicts, rest) = bytes.split_first_chunk::<8>()?;
        let seconds = f64::from_le_bytes(rest.try_into().ok()?);
        let verdicts = usize::try_from(u64::from_le_bytes(verdicts)).ok()?;
        let sound = seconds >= 0.0 && seconds.is_finite();
        sound.then_some(Self { error: None, seconds, verdicts })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_restored_and_nothing_else_is() {
        let bytes = DenoisedRecord { seconds: 1.5, verdicts: 3, error: None }.to_bytes();
        let again = DenoisedRecord::from_bytes(&bytes).unwrap();
        assert_eq!((again.seconds, again.verdicts), (1.5, 3));
        for length in 0..bytes.len() {
            assert!(DenoisedRecord::from_bytes(&bytes[..length]).is_none(), "{length}");
        }
        assert!(DenoisedRecord::from_bytes(&[&bytes[..], &[0]].concat()).is_none());
        let mut odd = bytes;
        odd[8..16].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(DenoisedRecord::from_bytes(&odd).is_none());
    }
}
