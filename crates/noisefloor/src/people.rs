//! The people who see no noise: which share of them is asked for, and how their thresholds scatter.

#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// The share of people who are to see no noise, strictly between 0 and 1.
///
/// ```
/// use noisefloor::People;
///
/// assert_eq!("95%".parse(), Ok(People::DEFAULT));
/// assert_eq!(People::DEFAULT.to_string(), "95%");
/// assert!(People::DEFAULT.are_satisfied_by(0.97));
/// assert!(People::new(1.0).is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "files", serde(try_from = "f32", into = "f32"))]
pub struct People(f32);

/// A share outside (0, 1).
#[derive(Debug, Error, Clone, PartialEq)]
#[error("the share of people who see no noise must lie between 0 and 1, as 0.95 or 95%, not {0}")]
pub struct PeopleError(String);

impl People {
    /// 95 % (Takouachet et al. 2017, §4.2.2).
    pub const DEFAULT: Self = Self(0.95);

    /// A share of one's own.
    ///
    /// # Errors
    /// [`PeopleError`] unless 0 < `share` < 1.
    pub fn new(share: f32) -> Result<Self, PeopleError> {
        if share > 0.0 && share < 1.0 { Ok(Self(share)) } else { Err(PeopleError(share.to_string())) }
    }

    /// The share.
    pub fn share(self) -> f32 {
        self.0
    }

    /// Whether at least that share sees no noise, if `probability` of them do not.
    pub fn are_satisfied_by(self, probability: f32) -> bool {
        probability >= self.0
    }
}

impl Default for People {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl TryFrom<f32> for People {
    type Error = PeopleError;

    fn try_from(share: f32) -> Result<Self, PeopleError> {
        Self::new(share)
    }
}

impl From<People> for f32 {
    fn from(people: People) -> Self {
        people.0
    }
}

impl FromStr for People {
    type Err = PeopleError;

    fn from_str(text: &str) -> Result<Self, PeopleError> {
        let wrong = || PeopleError(text.to_owned());
        let share = match text.trim().strip_suffix('%') {
            Some(percent) => percent.trim().parse::<f64>().map(|p| (p / 100.0) as f32),
            None => text.trim().parse(),
        };
        Self::new(share.map_err(|_| wrong())?).map_err(|_| wrong())
    }
}

impl fmt::Display for People {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // As many digits as tell it from its neighbours, without those of binary fractions
        let percent = (f64::from(self.0) * 100.0 * 1e4).round() / 1e4;
        write!(f, "{percent}%")
    }
}

/// How thresholds scatter around what a model expects, as standard deviations of ln(samples).
///
/// A model is learned from means over observers. What it expects in a scene is off by as much as it was in scenes
/// that were left out; and people differ from their mean. The share of people in a scene like these who see no noise
/// counts both.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub struct Spread {
    /// Of the mean observer's threshold in scenes that were left out, around what was expected.
    pub scenes: f64,
    /// Of single people's thresholds in one place. [`Spread::PEOPLE`] for people in general; that of a measurement,
    /// for a person who was measured.
    pub people: f64,
}

/// What is not known of a place, besides how scenes and people scatter: variances of the ln(samples) that it needs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Unknown {
    /// By the exposure of the picture.
    pub(crate) exposure: f64,
    /// By noise that few pixels carry.
    pub(crate) noise: f64,
    /// By texture that the model has not been tried on.
    pub(crate) texture: f64,
}

impl Unknown {
    /// Energy of noise grows with the square of the exposure at most: on a screen, in the dark; elsewhere with less.
    const EXPOSURE_POWER: f64 = 2.0;

    /// With this standard error of the exposure, and noise that so many pixels carry: its energy, one square for each of
    /// them, has a relative variance of 1/`carriers`. Without noise, there is none to be mistaken about.
    pub(crate) fn new(exposure_error: f64, carriers: f64) -> Self {
        let noise = if carriers > 0.0 { (1.0 / carriers).ln_1p() } else { 0.0 };
        Self { exposure: (Self::EXPOSURE_POWER * exposure_error).powi(2), noise, texture: 0.0 }
    }

    /// With `factor` times the samples: errors of means fall.
    pub(crate) fn after(self, factor: f64) -> Self {
        Self { exposure: self.exposure / factor, noise: self.noise / factor, ..self }
    }
}

impl Spread {
    /// Of people in general: 0.5, within 0.4 to 0.7. By table 2 of Takouachet et al. 2017 (94.4 % see no noise at the
    /// stop, 8.2 % at 30 % of it) 0.36 for whole pictures and 0.40 to 0.55 for one zone; 0.79 for the 16 people of
    /// ModelFest, 0.63 to 0.75 in three sets of contrast sensitivities with their noise of measurement, 0.44 in
    /// MCL-JCI, 0.53 to 0.67 for increments of noise, at most 0.45 between the zones of SIN3D. At 0.4 and 0.7, 95 %
    /// need ×0.93 and ×1.16 of what they need at 0.5, for the same mean.
    pub const PEOPLE: f64 = 0.5;
    /// Of that, the part that differs from place to place in one picture: whole pictures scatter by 0.36, single
    /// places by 0.5 (above), and the squares of independent parts add up.
    const PEOPLE_BY_PLACE: f64 = 0.347;
    /// The share of the variance between scenes that differs from place to place in one scene: an assumption.
    /// Predictions for scenes that were left out give 0.39 (2026-11-25).
    const SCENES_BY_PLACE: f64 = 1.0 / 3.0;

    /// How far ln(samples) lies above the median person's threshold, by the odds of the mean observer's.
    /// The mean of log-normal thresholds is exp(σ²/2) of their median.
    fn margin(&self, log_odds: f64) -> f64 {
        // A logistic distribution of scale s has the standard deviation s·π/√3
        log_odds * self.scenes * 3f64.sqrt() / std::f64::consts::PI + 0.5 * Self::PEOPLE * Self::PEOPLE
    }

    fn total(&self) -> f64 {
        self.scenes.hypot(self.people)
    }

    /// Share of people who see no noise, where the mean observer of this share of scenes, as log-odds, sees none, over all that
    /// is unknown. A log-normal energy lies above its median: of few carriers, more noise has gone unnoticed than noticed.
    /// What is unknown satisfies nobody.
    pub(crate) fn share(&self, log_odds: f64, Unknown { exposure, noise, texture }: Unknown) -> f64 {
        let (margin, variance) = (self.margin(log_odds), exposure + noise + texture);
        let known = normal_cdf(margin / self.total());
        known.min(normal_cdf((margin - 0.5 * noise) / self.total().hypot(variance.sqrt())))
    }

    /// Share of people who see no noise *anywhere* in a picture, from the share of people for each of its places and
    /// how many places in which people looked each stands for; see [`Spread::places`].
    ///
    /// What a person misses or sees is the same person's in all places, and a scene is the same scene: that part of
    /// both spreads is common to all places, the rest is independent in each. Integrated over the common part by the
    /// midpoint rule. Tiles smaller than a place stand for less than one; but whoever sees noise in a tile sees it in the picture,
    /// so that the share is at most that of the worst.
    pub fn share_in_picture(&self, places: impl Iterator<Item = (f32, f64)> + Clone) -> f64 {
        let by_person = self.people.min(Self::PEOPLE_BY_PLACE);
        let local = (Self::SCENES_BY_PLACE * self.scenes * self.scenes + by_person * by_person).sqrt();
        let common = (self.total().powi(2) - local * local).max(0.0).sqrt();
        const STEPS: usize = 200;
        let at = |step: usize| {
            let quantile = normal_quantile((step as f64 + 0.5) / STEPS as f64);
            let sees_none = |(share, count): (f32, f64)| {
                let margin = normal_quantile(f64::from(share)) * self.total() - common * quantile;
                normal_cdf(margin / local.max(1e-9)).max(1e-300).ln() * count
            };
            places.clone().map(sees_none).sum::<f64>().exp()
        };
        let worst = places.clone().map(|(share, _)| f64::from(share)).fold(1.0, f64::min);
        ((0..STEPS).map(at).sum::<f64>() / STEPS as f64).min(worst)
    }

    /// How many of the places in which people looked a tile stands for: they looked at zones of 128 to 200 pixels
    /// (Takouachet et al. 2017, §4.2.2; LISIC's data), some 4.3 degrees.
    pub fn places(pixels: usize, pixels_per_degree: f64) -> f64 {
        pixels as f64 / (4.3 * pixels_per_degree).powi(2)
    }
}

/// Φ, the share of a normal distribution below `x`.
fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)
}

/// Φ⁻¹, by bisection: within 10⁻¹² in [−9, 9], where it ends.
fn normal_quantile(p: f64) -> f64 {
    let (mut low, mut high) = (-9.0, 9.0);
    while high - low > 1e-12 {
        let middle = 0.5 * (low + high);
        if normal_cdf(middle) < p { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor_testkit::Noise;

    #[test]
    fn only_shares_between_nobody_and_everybody() {
        for text in ["0.95", "95%", " 95 % ", "95.0%"] {
            assert_eq!(text.parse(), Ok(People::DEFAULT), "{text}");
        }
        for (share, text) in [(0.9, "90%"), (0.999, "99.9%"), (0.5, "50%")] {
            assert_eq!(People::new(share).unwrap().to_string(), text);
        }
        for wrong in ["0", "1", "-0.5", "95", "100%", "0%", "NaN", "inf", "often", "%"] {
            let error = wrong.parse::<People>().unwrap_err();
            assert!(error.to_string().ends_with(wrong), "{error}");
        }
    }

    #[test]
    fn the_normal_distribution_is_that_of_the_tables() {
        for (x, p) in [(0.0, 0.5), (1.0, 0.841_344_746), (1.644_853_627, 0.95), (-2.575_829_304, 0.005)] {
            assert!((normal_cdf(x) - p).abs() < 1e-8 && (normal_quantile(p) - x).abs() < 1e-6);
        }
    }

    /// From the mean observer to 95 % of people: ×2.0 in a known scene, ×2.35 where scenes scatter by 0.32.
    #[test]
    fn people_need_more_than_their_mean() {
        for (scenes, needed) in [(1e-6, 2.0f64), (0.32, 2.35)] {
            let spread = Spread { scenes, people: 0.5 };
            let log_odds = needed.ln() / scenes * std::f64::consts::PI / 3f64.sqrt();
            assert!(
                (spread.share(log_odds, Unknown::default()) - 0.95).abs() < 0.002,
                "{scenes}: {}",
                spread.share(log_odds, Unknown::default())
            );
        }
    }

    /// A lone noisy tile of 32 pixels is a 26th of a place.
    #[test]
    fn a_picture_is_seen_no_better_than_its_worst_tile() {
        let spread = Spread { scenes: 0.4, people: 0.5 };
        let tile = Spread::places(32 * 32, 37.8);
        for worst in [0.1f32, 0.5, 0.9] {
            let share = spread.share_in_picture([(worst, tile), (0.999, 20.0 * tile)].into_iter());
            assert!(share <= f64::from(worst), "{worst}: {share}");
            assert_eq!(spread.share_in_picture([(worst, tile)].into_iter()), f64::from(worst));
        }
    }

    /// Simulated people in simulated scenes, each with thresholds in all places: the shares in one place and in the
    /// whole picture are those that are computed. Of 40,000 people, a share is known to 0.0025 (one deviation).
    #[test]
    fn shares_are_those_of_simulated_people() {
        let spread = Spread { scenes: 0.35, people: 0.5 };
        let local = [Spread::SCENES_BY_PLACE.sqrt() * spread.scenes, Spread::PEOPLE_BY_PLACE];
        let common = [
            (1.0 - Spread::SCENES_BY_PLACE).sqrt() * spread.scenes,
            (0.25 - Spread::PEOPLE_BY_PLACE.powi(2)).sqrt(),
        ];
        let mut noise = Noise::new(3);
        // ln(samples) of three places above what the mean observer is expected to need
        let above: [f64; 3] = [1.0, 0.6, 1.4];
        let people = 40_000;
        let (mut in_place, mut anywhere) = ([0u32; 3], 0u32);
        for _ in 0..people {
            let shared: f64 = common.iter().map(|sd| sd * noise.normal()).sum();
            let sees_none = above.map(|above| {
                let own: f64 = local.iter().map(|sd| sd * noise.normal()).sum();
                // The median person needs exp(−σ²/2) of the mean
                shared + own - 0.125 < above
            });
            in_place.iter_mut().zip(sees_none).for_each(|(count, none)| *count += u32::from(none));
            anywhere += u32::from(sees_none.iter().all(|&none| none));
        }
        let odds = |above: f64| above / spread.scenes * std::f64::consts::PI / 3f64.sqrt();
        let shares = above.map(|above| spread.share(odds(above), Unknown::default()));
        for (count, share) in in_place.into_iter().zip(shares) {
            assert!((f64::from(count) / f64::from(people) - share).abs() < 0.01, "{count} {share}");
        }
        let expected = spread.share_in_picture(shares.into_iter().map(|s| (s as f32, 1.0)));
        let found = f64::from(anywhere) / f64::from(people);
        assert!((found - expected).abs() < 0.01, "{found} {expected}");
        // Fewer than of the worst place, more than if places were independent
        assert!(expected < shares[1] && expected > shares.iter().product::<f64>());
    }
}
