//! How many of the observers are satisfied at a number of samples.

/// Share of observers who see no difference at the recorded threshold, as it is read here (Takouachet et al.
/// 2017, §4.2.2: "identical to the reference one by 95% of the observers"). The human data call it a mean
/// over observers and give no spread, so that this share and [`TrainParams::spread`](crate::TrainParams::spread) are one assumption
/// together: they place P = 0.9 where predictions on left-out scenes are neither early nor late.
pub const OBSERVERS_AT_THRESHOLD: f64 = 0.95;

/// Share of observers who see no difference at `spp` samples in a zone with the recorded threshold `human`: a
/// logistic psychometric function of ln(spp), which is [`OBSERVERS_AT_THRESHOLD`] at the threshold.
pub fn observers_agreeing(spp: f64, human: f64, spread: f64) -> f64 {
    let at_threshold = (OBSERVERS_AT_THRESHOLD / (1.0 - OBSERVERS_AT_THRESHOLD)).ln();
    1.0 / (1.0 + (-(spp / human).ln() / spread - at_threshold).exp())
}
