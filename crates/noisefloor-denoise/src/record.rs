//! What is known of the verdicts on denoised pictures besides the verdicts.

use crate::estimate::DenoisedError;

/// What the last verdicts looked at, for reports.
#[derive(Clone, Debug, Default)]
pub struct DenoisedRecord {
    /// The error of the denoised picture at the last verdict.
    pub error: Option<DenoisedError>,
    /// For each tile, the just-objectionable differences lost when it was last judged; NaN before that.
    pub jods_lost: Vec<f64>,
    /// Seconds spent on denoising and on the estimates from it.
    pub seconds: f64,
    /// Verdicts so far: each takes two denoisings.
    pub verdicts: usize,
}

impl DenoisedRecord {
    /// Everything but the error picture: the number of verdicts, the seconds, then the loss of each tile, in eight
    /// bytes each, little-endian.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(16 + 8 * self.jods_lost.len());
        bytes.extend((self.verdicts as u64).to_le_bytes());
        bytes.extend(self.seconds.to_le_bytes());
        self.jods_lost.iter().for_each(|lost| bytes.extend(lost.to_le_bytes()));
        bytes
    }

    /// What [`DenoisedRecord::to_bytes`] returned for so many tiles; `None` if it did not.
    pub(crate) fn from_bytes(tiles: usize, bytes: &[u8]) -> Option<Self> {
        let (words, []) = bytes.as_chunks::<8>() else { return None };
        let [verdicts, seconds, rest @ ..] = words else { return None };
        let (verdicts, seconds) = (u64::from_le_bytes(*verdicts), f64::from_le_bytes(*seconds));
        // Before the first verdict there are no tiles
        let expected = if verdicts == 0 { 0 } else { tiles };
        if rest.len() != expected || !(seconds >= 0.0 && seconds.is_finite()) {
            return None;
        }
        let jods_lost = rest.iter().map(|lost| f64::from_le_bytes(*lost)).collect();
        let verdicts = usize::try_from(verdicts).ok()?;
        Some(Self { error: None, jods_lost, seconds, verdicts })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_restored_and_nothing_else_is() {
        let record = DenoisedRecord { jods_lost: vec![0.25, 0.5], seconds: 1.5, verdicts: 3, error: None };
        let bytes = record.to_bytes();
        let again = DenoisedRecord::from_bytes(2, &bytes).unwrap();
        assert_eq!((again.jods_lost, again.seconds, again.verdicts), (record.jods_lost, 1.5, 3));
        assert!(DenoisedRecord::from_bytes(2, &DenoisedRecord::default().to_bytes()).is_some());
        for length in 0..bytes.len() {
            assert!(DenoisedRecord::from_bytes(2, &bytes[..length]).is_none(), "{length}");
        }
        assert!(DenoisedRecord::from_bytes(3, &bytes).is_none());
        let mut odd = bytes;
        odd[8..16].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(DenoisedRecord::from_bytes(2, &odd).is_none());
    }
}
