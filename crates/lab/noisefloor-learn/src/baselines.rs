//! Predictors that a model has to beat.

use crate::predict::{Prediction, crossing};
use crate::stimulus::as_difference;
use crate::table::{Table, Zone};
use statrs::statistics::{Data, Median};
use std::collections::BTreeMap;

/// The constant-noise baseline: a zone has converged once the standard deviation of its noise mask falls to
/// one constant. Of the noise levels at the human thresholds of all other groups, it is the one that errs
/// least on those groups. In a table of one group there are no others: the constant is then fitted to what it
/// predicts, and flattered.
pub fn constant_noise_baseline(table: &Table) -> Vec<Prediction> {
    // Quietness −ln(noise) grows with samples.
    let zones: Vec<(&Zone, Vec<(f64, f64)>)> = table
        .zones
        .iter()
        .map(|zone| (zone, zone.path(|i| -f64::from(zone.levels[i].noise).max(1e-9).ln())))
        .filter(|(_, path)| path.len() > 1)
        .collect();
    let predict = |(zone, path): &(&Zone, Vec<(f64, f64)>), quietness: f64| {
        let as_noise = crossing(path, quietness).unwrap_or(f64::INFINITY);
        Prediction::by_threshold(zone, as_difference(as_noise, zone.reference_spp))
    };
    let constant = |left_out: &str| {
        let alone = zones.iter().all(|(z, _)| z.group == left_out);
        let others = || zones.iter().filter(|(z, _)| (alone || z.group != left_out) && !z.censored);
        let error =
            |constant: f64| others().map(|other| predict(other, constant).log_ratio().abs()).sum::<f64>();
        let candidates = others().filter_map(|(zone, path)| value_at(path, zone.human_as_noise()));
        candidates.map(|c| (error(c), c)).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, c)| c)
    };
    let of_group: BTreeMap<&str, Option<f64>> =
        table.groups().into_iter().map(|g| (g, constant(g))).collect();
    zones.iter().filter_map(|zone| Some(predict(zone, of_group[zone.0.group.as_str()]?))).collect()
}

/// A quantity at given samples, interpolated in ln(spp) between the levels around it.
fn value_at(levels: &[(f64, f64)], spp: f64) -> Option<f64> {
    let after = levels.iter().position(|&(n, _)| n >= spp).unwrap_or(levels.len() - 1).max(1);
    let (&(n0, v0), &(n1, v1)) = (levels.get(after - 1)?, levels.get(after)?);
    Some(v0 + (v1 - v0) * ((spp / n0).ln() / (n1 / n0).ln()).clamp(0.0, 1.0))
}

/// The scene-median baseline: the median threshold of the same scene's other zones, which no predictor of
/// unseen scenes can know. Scenes of a single zone stay out.
pub fn scene_median_baseline(table: &Table) -> Vec<Prediction> {
    let predict = |zone: &Zone| {
        let same = |o: &&Zone| o.scene == zone.scene && o.zone != zone.zone && !o.censored;
        let others: Vec<f64> = table.zones.iter().filter(same).map(|o| o.human_spp).collect();
        // The median of nothing is no number.
        (!others.is_empty()).then(|| Prediction::by_threshold(zone, Data::new(others).median()))
    };
    table.zones.iter().filter_map(predict).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::score;
    use crate::table::tests::zone;
    use noisefloor::{descriptor::Descriptor, evidence::Evidence};

    /// Two scenes that people stop at the same noise: the baseline that knows this finds their thresholds
    /// exactly.
    #[test]
    fn constant_noise_is_right_where_noise_is_all() {
        let zones = vec![zone("A", 0, 100.0, 1.0), zone("B", 0, 400.0, 2.0)];
        let table = Table::new(Descriptor::default(), Evidence::Halves, zones);
        let scores = score(constant_noise_baseline(&table).iter());
        assert!((scores.error_factor - 1.0).abs() < 1e-3, "{scores:?}");
        assert_eq!(scene_median_baseline(&table), vec![]);
    }
}
