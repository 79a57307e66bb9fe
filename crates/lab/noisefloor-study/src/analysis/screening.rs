//! Who is excluded, by the rules that the study file fixed before anyone answered, and why.

use super::observers::{Observer, places};
use super::summary::median;
use crate::config::{Study, StudyProtocol};
use crate::session::{Class, Haste, Stage};
use crate::stack::ln_spp;
use noisefloor_pages::viewing::ViewingProblem;
use std::collections::BTreeSet;

/// Fewest observers among whom BT.500 looks for one unlike the others.
const FEWEST: usize = 5;
/// Fewest observers whose median deviation is known well enough to judge one of them by it. Among eight, one
/// attentive observer in nine would be called an outlier.
const FEWEST_FOR_DEVIATION: usize = 20;
/// Smallest median deviation assumed, in ln(spp): where all agree to within a level, half a level is no
/// outlier.
const LEAST_DEVIATION: f64 = 0.05;
/// Standard deviation of a normal distribution in units of its median absolute deviation.
const MAD_TO_SD: f64 = 1.4826;

/// Rules that one session breaks by itself, in words. A session under way may still mend some.
pub fn individual(observer: &Observer, study: &Study) -> Vec<String> {
    let rules = &study.screening;
    let mut broken = Vec::new();
    if observer.stage == Stage::ScreenedOut {
        broken.push("did not pass the practice".to_owned());
    }
    if let Some(problem) = observer.viewing_problem {
        let what = match problem {
            ViewingProblem::Distance => "distance",
            ViewingProblem::PixelsPerDegree => "pixels per degree",
            ViewingProblem::Gamma => "gamma",
            ViewingProblem::Ambient => "light in the room",
        };
        broken.push(format!("viewing conditions outside the limits: {what}"));
    }
    let (of, failed) = (observer.caught.len(), observer.caught.iter().filter(|(_, passed)| !passed).count());
    if failed as f64 > rules.catch_errors * of as f64 {
        broken.push(format!("failed {failed} of {of} catch trials"));
    }
    let Haste { trials, hasty } = observer.haste;
    if f64::from(hasty) > rules.hasty_share * f64::from(trials) {
        broken.push(format!("answered {hasty} of {trials} trials in less than {} ms", rules.hasty_ms));
    }
    let stops = || observer.stops.values().flatten();
    let (all, untouched) = (stops().count(), stops().filter(|level| **level == 0).count());
    if study.protocol == StudyProtocol::Acquisition && untouched as f64 > rules.untouched_share * all as f64 {
        broken.push(format!("left {untouched} of {all} tiles at the noisiest level"));
    }
    broken.extend(blind(observer));
    broken
}

/// Why the answers of a validation do not depend on the stimulus.
fn blind(observer: &Observer) -> Option<String> {
    let share = |class: Class| {
        let (identical, judged) = observer.called_identical(class);
        (judged > 0).then(|| identical as f64 / judged as f64)
    };
    let (reference, noisy) = (share(Class::Reference)?, share(Class::Noisy)?);
    (noisy >= reference).then(|| {
        let [noisy, reference] = [noisy, reference].map(|s| 100.0 * s);
        format!("called {noisy:.0} % of noisy and {reference:.0} % of reference pairs identical")
    })
}

/// Why each observer is excluded; empty for those who count. Rules that compare observers look only at those
/// who break none by themselves: a few who click at random must not hide each other.
pub(crate) fn exclusions(observers: &[Observer], study: &Study) -> Vec<Vec<String>> {
    let mut reasons: Vec<Vec<String>> = observers.iter().map(|o| individual(o, study)).collect();
    let mut seen = BTreeSet::new();
    for (observer, reasons) in observers.iter().zip(&mut reasons) {
        if !observer.ids.is_empty() && !seen.insert(&observer.ids) {
            reasons.push("second session of the same participant".to_owned());
        }
    }
    let compared: Vec<usize> = (0..observers.len()).filter(|&i| reasons[i].is_empty()).collect();
    let among: Vec<&Observer> = compared.iter().map(|&i| &observers[i]).collect();
    let table = LnThresholds::new(&among, study);
    for (of, &i) in compared.iter().enumerate() {
        let limit = study.screening.outlying;
        if let Some(z) = modified_z(&table.sensitivities, of).filter(|z| z.abs() > limit) {
            reasons[i].push(format!("thresholds unlike the others' (modified z = {z:.1})"));
        }
        if let Some(z) = modified_z(&table.inconsistencies, of).filter(|z| *z > limit) {
            reasons[i].push(format!("showings of a tile far apart (modified z = {z:.1})"));
        }
        if study.screening.bt500
            && let Some([above, below, of_all]) = table.bt500(of)
        {
            reasons[i].push(format!(
                "ITU-R BT.500: {above} thresholds far above and {below} far below the others', of {of_all}"
            ));
        }
    }
    reasons
}

/// Ratio of each observer's thresholds to the median of the others' (median over tiles).
pub fn sensitivities(observers: &[&Observer], study: &Study) -> Vec<Option<f64>> {
    LnThresholds::new(observers, study).sensitivities.into_iter().map(|s| s.map(f64::exp)).collect()
}

/// ln(threshold) by observer, then tile, and what follows from it.
struct LnThresholds {
    table: Vec<Vec<Option<f64>>>,
    /// Median over tiles of ln(own threshold/median of the others').
    sensitivities: Vec<Option<f64>>,
    /// Median over tiles of the distance between the showings.
    inconsistencies: Vec<Option<f64>>,
}

impl LnThresholds {
    fn new(observers: &[&Observer], study: &Study) -> Self {
        let places = places(study);
        let row = |o: &&Observer| places.iter().map(|&p| o.threshold(study, p).map(f64::ln)).collect();
        let table: Vec<Vec<Option<f64>>> = observers.iter().map(row).collect();
        let sensitivity = |of: usize| {
            let differences = (0..places.len()).filter_map(|p| {
                let own = table[of][p]?;
                let others = (0..table.len()).filter(|&o| o != of).filter_map(|o| table[o][p]);
                Some(own - median(others.collect())?)
            });
            median(differences.collect())
        };
        let inconsistency = |o: &&Observer| {
            let apart = places.iter().filter_map(|place| {
                let spp = study.stacks[place.0 as usize].levels();
                let stops = o.stops.get(place).filter(|s| s.len() > 1)?;
                Some(ln_spp(spp, *stops.iter().max()?) - ln_spp(spp, *stops.iter().min()?))
            });
            median(apart.collect())
        };
        let sensitivities = (0..table.len()).map(sensitivity).collect();
        Self { sensitivities, inconsistencies: observers.iter().map(inconsistency).collect(), table }
    }

    /// Recommendation ITU-R BT.500-15, annex 1, §2.3.1: thresholds more than 2 (if they are spread normally
    /// by their kurtosis, else √20) standard deviations above or below the mean are counted. An observer with
    /// more than 5 % of them, on both sides alike, is rejected: `[above, below, all]`.
    fn bt500(&self, of: usize) -> Option<[usize; 3]> {
        let (mut above, mut below, mut all) = (0, 0, 0);
        for tile in 0..self.table.first()?.len() {
            let values: Vec<f64> = self.table.iter().filter_map(|row| row[tile]).collect();
            let Some(own) = self.table[of][tile].filter(|_| values.len() >= FEWEST) else { continue };
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            let moment = |power: i32| values.iter().map(|v| (v - mean).powi(power)).sum::<f64>() / n;
            let kurtosis = moment(4) / moment(2).powi(2);
            let factor = if (2.0..=4.0).contains(&kurtosis) { 2.0 } else { 20f64.sqrt() };
            let limit = factor * (moment(2) * n / (n - 1.0)).sqrt();
            above += usize::from(own >= mean + limit);
            below += usize::from(own <= mean - limit);
            all += 1;
        }
        let (p, q) = (above as f64, below as f64);
        ((p + q) / all as f64 > 0.05 && ((p - q) / (p + q)).abs() < 0.3).then_some([above, below, all])
    }
}

/// Modified z-score of a value (Iglewicz and Hoaglin 1993, "How to detect and handle outliers", §3.3). The
/// default limit is 5, not their 3.5, which one logistic value in 150 exceeds: that would exclude part of the
/// spread to be measured.
fn modified_z(values: &[Option<f64>], of: usize) -> Option<f64> {
    let all: Vec<f64> = values.iter().flatten().copied().collect();
    if all.len() < FEWEST_FOR_DEVIATION {
        return None;
    }
    let middle = median(all.clone())?;
    let deviation = median(all.iter().map(|v| (v - middle).abs()).collect())?.max(LEAST_DEVIATION);
    Some((values[of]? - middle) / (MAD_TO_SD * deviation))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forty observers agree on forty tiles up to a known ripple; one of them is far above on a third of the
    /// tiles and far below on another third, which the rule is made for. One who is always far above is not
    /// its business.
    #[test]
    fn bt500_rejects_who_errs_to_both_sides() {
        let ripple = |o: usize, t: usize| ((o * 7 + t * 3) % 11) as f64 / 10.0 - 0.5;
        let table = |shift: &dyn Fn(usize) -> f64| {
            let row = |o: usize| {
                (0..40).map(|t| Some(ripple(o, t) + if o == 0 { shift(t) } else { 0.0 })).collect()
            };
            let table = (0..40).map(row).collect();
            LnThresholds { table, sensitivities: Vec::new(), inconsistencies: Vec::new() }
        };
        let erratic = table(&|t| [3.0, -3.0, 0.0][t % 3]);
        assert!(erratic.bt500(0).is_some() && erratic.bt500(1).is_none());
        assert!(table(&|_| 3.0).bt500(0).is_none());
        assert!(table(&|_| 0.0).bt500(0).is_none());
    }
}
