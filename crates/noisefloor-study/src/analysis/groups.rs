//! Groups of observers against each other, as in Takouachet et al. 2017, §7.3.

use super::observers::{Observer, places};
use crate::config::Study;
use noisefloor::Audience;
use noisefloor_learn::AudienceFit;
use serde::Serialize;

/// The line from the thresholds of the first group to those of another.
#[derive(Clone, Debug, Serialize)]
pub struct GroupLine {
    /// The group that T stands for.
    pub from: String,
    /// The group that T′ stands for.
    pub to: String,
    /// Observers of each.
    pub observers: [usize; 2],
    /// Tiles that both gave thresholds for.
    pub tiles: usize,
    /// Simple regression by least squares, as in the paper; `None` if all T are the same.
    pub least_squares: Option<Audience>,
    /// Robust line with intervals and r: the one to pass to `render --audience`. `None` if it cannot be
    /// fitted.
    pub robust: Option<AudienceFit>,
    /// Why there is no robust line.
    pub problem: Option<String>,
}

/// Lines from the first group of the study to every other group with observers.
pub(super) fn lines(study: &Study, observers: &[&Observer]) -> Vec<GroupLine> {
    let of =
        |group: &str| -> Vec<&Observer> { observers.iter().copied().filter(|o| o.group == group).collect() };
    let Some((first, others)) = study.groups.split_first() else { return Vec::new() };
    let base = of(first);
    let line = |group: &String| {
        let group_observers = of(group);
        if base.is_empty() || group_observers.is_empty() {
            return None;
        }
        let pairs: Vec<(f64, f64)> = places(study)
            .into_iter()
            .filter_map(|p| Some((mean(study, &base, p)?, mean(study, &group_observers, p)?)))
            .collect();
        let robust = AudienceFit::new(&pairs);
        Some(GroupLine {
            from: first.clone(),
            to: group.clone(),
            observers: [base.len(), group_observers.len()],
            tiles: pairs.len(),
            least_squares: least_squares(&pairs),
            problem: robust.as_ref().err().map(ToString::to_string),
            robust: robust.ok(),
        })
    };
    others.iter().filter_map(line).collect()
}

fn mean(study: &Study, observers: &[&Observer], place: (u32, u32)) -> Option<f64> {
    let all: Vec<f64> = observers.iter().filter_map(|o| o.threshold(study, place)).collect();
    (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
}

fn least_squares(pairs: &[(f64, f64)]) -> Option<Audience> {
    let n = pairs.len() as f64;
    let (x, y) = (pairs.iter().map(|p| p.0).sum::<f64>() / n, pairs.iter().map(|p| p.1).sum::<f64>() / n);
    let xy: f64 = pairs.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    let xx: f64 = pairs.iter().map(|p| (p.0 - x).powi(2)).sum();
    let slope = xy / xx;
    slope.is_finite().then_some(Audience { slope, offset: y - slope * x })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exact_line_is_found() {
        let pairs: Vec<(f64, f64)> = (1..6).map(|i| (f64::from(i), 2.0 * f64::from(i) - 3.0)).collect();
        let line = least_squares(&pairs).unwrap();
        assert!((line.slope - 2.0).abs() < 1e-12 && (line.offset + 3.0).abs() < 1e-12);
        assert_eq!(least_squares(&[(1.0, 2.0), (1.0, 3.0)]), None);
    }
}
