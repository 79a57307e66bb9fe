//! The results of an analysis.

use super::agreement::{self, BetweenObservers, RepeatAgreement};
use super::interval::{bootstrap, wilson};
use super::observers::{self, Observer, places};
use super::screening;
use super::spread::{PeopleSpread, spreads};
use super::tiles::{self, TileRow};
use crate::config::{Study, StudyProtocol};
use crate::error::StudyError;
use crate::session::{Class, Stage};
use crate::store::read_all;
use noisefloor::Audience;
use noisefloor_learn::AudienceFit;
use serde::Serialize;
use std::sync::Arc;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnalysisOptions {
    /// Whether to keep observers whom the rules of the study exclude.
    pub keep_excluded: bool,
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Whether to analyse simulated observers instead of people; they are never mixed.
    pub simulated: bool,
}

#[derive(Clone, Debug, Serialize)]
pub struct StudyReport {
    pub noisefloor: &'static str,
    pub protocol: StudyProtocol,
    pub simulated: bool,
    /// All sessions with an answer.
    pub observers: Vec<ObserverRow>,
    /// Thresholds of the tiles, from the observers who count; empty for a validation.
    pub tiles: Vec<TileRow>,
    /// Agreement of each observer with themselves.
    pub repeats: Option<RepeatAgreement>,
    /// Agreement of the observers with each other.
    pub between: Option<BetweenObservers>,
    /// How far single people lie from each other, over all stacks and in each; empty unless several observers saw
    /// tiles twice.
    pub spread: Vec<PeopleSpread>,
    /// Thresholds of each group against the first one (Takouachet et al. 2017, §7.3).
    pub groups: Vec<GroupLine>,
    /// Validation: the paper's Table 2.
    pub classes: Vec<ClassRow>,
}

/// Analyses all stored answers of a study.
pub fn analyse(study: &Arc<Study>, options: AnalysisOptions) -> Result<StudyReport, StudyError> {
    let mut records = read_all(&study.database, &study.design())?;
    records.retain(|record| record.simulated == options.simulated);
    let observers = observers::replay_all(study, &records)?;
    if observers.is_empty() {
        let who = if options.simulated { "simulated observers" } else { "people" };
        let what = format!("{}: no answers of {who} yet; nothing to analyse", study.database.display());
        return Err(StudyError::Other(what));
    }
    Ok(report(study, &observers, options))
}

pub fn report(study: &Study, observers: &[Observer], options: AnalysisOptions) -> StudyReport {
    let rows = observer_rows(study, observers);
    let counts = |row: &ObserverRow| options.keep_excluded || row.excluded.is_none();
    let kept: Vec<&Observer> =
        observers.iter().zip(&rows).filter(|(_, row)| counts(row)).map(|(o, _)| o).collect();
    let thresholds = study.protocol != StudyProtocol::Validation;
    StudyReport {
        noisefloor: env!("CARGO_PKG_VERSION"),
        protocol: study.protocol,
        simulated: options.simulated,
        tiles: if thresholds { tiles::rows(study, &kept, options.seed) } else { Vec::new() },
        repeats: agreement::repeats(study, &kept),
        between: agreement::between(study, &kept),
        spread: if thresholds { spreads(study, &kept) } else { Vec::new() },
        groups: if thresholds { group_lines(study, &kept) } else { Vec::new() },
        classes: class_rows(&kept, options.seed),
        observers: rows,
    }
}

// Validation: how often pairs of each class are called identical (Takouachet et al. 2017, Table 2).

/// A line of `classes.csv`.
#[derive(Clone, Debug, Serialize)]
pub struct ClassRow {
    pub class: Class,
    pub identical: usize,
    pub answers: usize,
    /// `identical / answers`.
    pub share: f64,
    /// Wilson's 95 % interval, valid for independent answers.
    pub wilson_low: f64,
    pub wilson_high: f64,
    /// 95 % interval over observers: wider where answers of one observer are alike.
    pub observers_low: Option<f64>,
    pub observers_high: Option<f64>,
}

/// The table; empty without answers.
fn class_rows(observers: &[&Observer], seed: u64) -> Vec<ClassRow> {
    let row = |class: Class| {
        let counts: Vec<(usize, usize)> = observers.iter().map(|o| o.called_identical(class)).collect();
        let (identical, answers) = counts.iter().fold((0, 0), |(yes, of), c| (yes + c.0, of + c.1));
        if answers == 0 {
            return None;
        }
        let among = |weights: &[f64]| {
            let sum = |f: &dyn Fn(&(usize, usize)) -> usize| -> f64 {
                counts.iter().zip(weights).map(|(c, w)| f(c) as f64 * w).sum()
            };
            Some([sum(&|c| c.0) / sum(&|c| c.1)])
        };
        let share = identical as f64 / answers as f64;
        let [wilson_low, wilson_high] = wilson(identical, answers);
        let over_observers = bootstrap(counts.len(), seed, [share], among);
        let [observers_low, observers_high] = [0, 1].map(|end| over_observers.map(|[ends]| ends[end]));
        Some(ClassRow {
            class,
            identical,
            answers,
            share,
            wilson_low,
            wilson_high,
            observers_low,
            observers_high,
        })
    };
    [Class::Reference, Class::Test, Class::Noisy].into_iter().filter_map(row).collect()
}

// Groups of observers against each other, as in Takouachet et al. 2017, §7.3.

/// The line from the thresholds of the first group to those of another.
#[derive(Clone, Debug, Serialize)]
pub struct GroupLine {
    /// The group that T stands for.
    pub from: String,
    /// The group that T′ stands for.
    pub to: String,
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
fn group_lines(study: &Study, observers: &[&Observer]) -> Vec<GroupLine> {
    let members =
        |group: &str| -> Vec<&Observer> { observers.iter().copied().filter(|o| o.group == group).collect() };
    let Some((first, others)) = study.groups.split_first() else { return Vec::new() };
    let base = members(first);
    let line = |group: &String| {
        let group_observers = members(group);
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

// The table of observers, with the reasons of those who are excluded.

#[derive(Clone, Debug, Serialize)]
pub struct ObserverRow {
    pub code: String,
    pub group: String,
    /// Whether all trials were answered.
    pub finished: bool,
    pub clicks: u64,
    /// Tiles with a threshold.
    pub tiles: usize,
    pub catch_trials: usize,
    pub catch_errors: usize,
    /// Ratio of this observer's thresholds to the median of the others' (median over tiles).
    pub sensitivity: Option<f64>,
    /// Pixels per degree of visual angle.
    pub pixels_per_degree: Option<f64>,
    /// Gamma of the screen, as matched by the observer.
    pub gamma: Option<f64>,
    /// Why the rules of the study exclude this observer, if they do.
    pub excluded: Option<String>,
}

fn observer_rows(study: &Study, observers: &[Observer]) -> Vec<ObserverRow> {
    let all: Vec<&Observer> = observers.iter().collect();
    let sensitivities = screening::sensitivities(&all, study);
    let exclusions = screening::exclusions(observers, study);
    let row = |((o, sensitivity), reasons): ((&Observer, Option<f64>), Vec<String>)| ObserverRow {
        code: o.code.clone(),
        group: o.group.clone(),
        finished: o.stage == Stage::Finished,
        clicks: o.clicks,
        tiles: o.stops.len().max(o.measured.len()),
        catch_trials: o.caught.len(),
        catch_errors: o.caught.iter().filter(|(_, passed)| !passed).count(),
        sensitivity,
        pixels_per_degree: o.conditions.map(|c| c.pixels_per_degree()),
        gamma: o.conditions.map(|c| c.gamma),
        excluded: (!reasons.is_empty()).then(|| reasons.join("; ")),
    };
    observers.iter().zip(sensitivities).zip(exclusions).map(row).collect()
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
