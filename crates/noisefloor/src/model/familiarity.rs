//! The textures that a model has been tried on.

#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};

/// How much more thresholds scatter, as a standard deviation of ln(samples), in a tile that is unlike all known ones: where 95 % of
/// people are asked for, it takes twice the samples.
pub(crate) const UNFAMILIAR: f64 = 0.86;

/// The textures that a model knows, as scaled numbers of its descriptor that describe the picture and not the
/// noise.
///
/// A tile is familiar if it lies near one of the training zones. How near follows from held-out scenes: 95 %
/// of their zones are that near to a zone of another scene. The scores of held-out scenes are evidence for
/// such tiles, and for no others. Noise plays no part, since every tile goes from noisier to cleaner than
/// anything in the training data.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub struct Familiarity {
    /// The scaled texture numbers of each training zone at its human threshold.
    pub zones: Vec<Vec<f32>>,
    /// Greatest distance to the nearest of them at which a tile is familiar, in standard deviations of the
    /// training data.
    pub reach: f32,
}

impl Familiarity {
    /// Whether scaled texture numbers lie within reach of a training zone; numbers that are not finite do
    /// not.
    pub fn includes(&self, numbers: &[f32]) -> bool {
        nearest(&self.zones, numbers) <= self.reach
    }

    /// How unlike all training zones scaled texture numbers are: 0 within reach, 1 from twice the reach on, and in
    /// proportion between, so that of two tiles that look the same one does not get twice the samples of the other.
    pub(crate) fn strangeness(&self, numbers: &[f32]) -> f32 {
        let beyond = nearest(&self.zones, numbers) / self.reach.max(f32::MIN_POSITIVE) - 1.0;
        // Numbers that are not finite are as strange as can be
        if beyond.is_nan() { 1.0 } else { beyond.clamp(0.0, 1.0) }
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
        assert_eq!(
            [1.0, 1.25, 2.0, 7.0, f32::NAN].map(|x| known.strangeness(&[-x, 0.0])),
            [0.0, 0.25, 1.0, 1.0, 1.0]
        );
        assert_eq!(nearest(&known.zones, &[3.0, 0.0]), 3.0);
        assert_eq!(nearest(&[] as &[Vec<f32>], &[3.0, 0.0]), f32::INFINITY);
    }
}
