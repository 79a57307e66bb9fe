//! Medians and correlations, by `statrs`, of samples that may be empty.

use statrs::statistics::{Data, Median, Statistics};

/// Median; `None` of no values.
pub(super) fn median(values: Vec<f64>) -> Option<f64> {
    (!values.is_empty()).then(|| Data::new(values).median())
}

/// Pearson correlation; `None` if one side is constant or there are fewer than two pairs.
pub(super) fn pearson(pairs: &[(f64, f64)]) -> Option<f64> {
    let (x, y): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
    let r = x.iter().covariance(y.iter()) / (x.iter().std_dev() * y.iter().std_dev());
    r.is_finite().then(|| r.clamp(-1.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        assert_eq!(median(vec![]), None);
        assert_eq!((median(vec![3.0, 1.0, 2.0]), median(vec![4.0, 1.0])), (Some(2.0), Some(2.5)));
        assert!((pearson(&[(1.0, 2.0), (2.0, 4.0), (4.0, 8.0)]).unwrap() - 1.0).abs() < 1e-12);
        assert_eq!((pearson(&[(1.0, 2.0), (1.0, 3.0)]), pearson(&[(1.0, 2.0)])), (None, None));
    }
}
