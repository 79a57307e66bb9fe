//! How gradually noise disappears for the observers of a zone.

/// Share of observers who see no difference in a picture whose noise is that of `spp` samples, in a zone where they
/// just see that of `threshold` samples: a logistic psychometric function of ln(spp), one half at the threshold.
pub(crate) fn observers_agreeing(spp: f64, threshold: f64, spread: f64) -> f64 {
    1.0 / (1.0 + (-(spp / threshold).ln() / spread).exp())
}
