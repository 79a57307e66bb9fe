//! What pictures a model has been tried on, so that it can say where it has not.

use serde::{Deserialize, Serialize};

/// Times the samples that an unfamiliar tile gets: P is that of the tile with this part of its samples. Noise falls with the samples
/// whatever the texture, so that such a tile stops too, at twice what the model expects.
pub(crate) const CAUTION: f32 = 2.0;

/// The pictures that a model knows, by those of its scaled numbers that describe the picture and not the noise.
///
/// A tile is familiar if it lies near one of the training zones; how near, scenes say that were left out: of their zones, 95 % are
/// that near to a zone of another scene. The scores of left-out scenes are evidence for such tiles, and for no others. Noise plays no
/// part in it: every tile goes from noisier to cleaner than anything in the training data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Familiarity {
    /// The scaled picture numbers of each training zone at its human threshold.
    pub zones: Vec<Vec<f32>>,
    /// Distance to the nearest of them up to which a tile is familiar, in standard deviations of the training data.
    pub reach: f32,
}

impl Familiarity {
    /// Whether scaled picture numbers lie within reach of a training zone; numbers that are not finite do not.
    pub fn includes(&self, numbers: &[f32]) -> bool {
        nearest(&self.zones, numbers) <= self.reach
    }
}

/// Distance of `point` to the nearest of `others`, which have its length; infinite if there are none.
pub fn nearest<'a>(others: impl IntoIterator<Item = &'a Vec<f32>>, point: &[f32]) -> f32 {
    let distance =
        |other: &Vec<f32>| other.iter().zip(point).map(|(a, b)| (a - b) * (a - b)).sum::<f32>().sqrt();
    others.into_iter().map(distance).fold(f32::INFINITY, f32::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_near_a_zone_is_familiar() {
        let known = Familiarity { zones: vec![vec![0.0, 0.0], vec![3.0, 4.0]], reach: 1.0 };
        assert!(known.includes(&[0.6, 0.8]) && known.includes(&[3.0, 4.9]));
        assert!(
            !known.includes(&[1.5, 2.0])
                && !known.includes(&[f32::NAN, 0.0])
                && !known.includes(&[1e30, 0.0])
        );
        assert_eq!(nearest(&known.zones, &[3.0, 0.0]), 3.0);
        assert_eq!(nearest(&[] as &[Vec<f32>], &[3.0, 0.0]), f32::INFINITY);
    }
}
