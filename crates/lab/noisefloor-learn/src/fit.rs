//! Choosing C and γ, and calibrating P, by leaving groups of scenes out.

use crate::answer::Answer;
use crate::machine::Fitted;
use crate::params::{TrainError, TrainParams};
use crate::predict::{Prediction, predict};
use crate::score::score;
use crate::table::{Table, Zone};
use noisefloor::svm::{SvmParams, SvmTrainError, fit_platt};
use noisefloor::{
    Audience, People,
    internal::nearest,
    model::{Familiarity, ModelParts, TrainingRecord},
    oracle::Spread,
    svm::{Classifier, Platt, Scaler},
};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// What may be learned from: the zones of some groups, and the answers of these and of all groups without
/// zones.
struct Material<'a> {
    table: &'a Table,
    params: &'a TrainParams,
    zones: Vec<&'a Zone>,
    answers: Vec<&'a Answer>,
}

/// A machine that has not seen one group, and the zones of that group.
struct Fold<'a> {
    machine: Fitted,
    zones: Vec<&'a Zone>,
}

/// A sigmoid, fitted to examples that the machine has not seen, and the [`order`] of these.
#[derive(Clone, Copy)]
struct Sigmoid {
    platt: Platt,
    order: f64,
}

impl<'a> Material<'a> {
    fn of(table: &'a Table, groups: &[&str], params: &'a TrainParams) -> Self {
        let all = table.groups();
        let wanted = |z: &&Zone| groups.contains(&z.group.as_str());
        let known = |a: &&Answer| groups.contains(&a.group.as_str()) || !all.contains(&a.group.as_str());
        Self {
            table,
            params,
            zones: table.zones.iter().filter(wanted).collect(),
            answers: table.answers.iter().filter(known).collect(),
        }
    }

    fn without_answers(&self) -> Self {
        Self { answers: Vec::new(), zones: self.zones.clone(), ..*self }
    }

    /// A machine trained on everything but one group.
    fn fit_without(&self, group: Option<&str>, svm: SvmParams) -> Result<Fitted, TrainError> {
        let zones: Vec<&Zone> = self.zones.iter().copied().filter(|z| Some(&*z.group) != group).collect();
        let answers: Vec<&Answer> =
            self.answers.iter().copied().filter(|a| Some(&*a.group) != group).collect();
        let least = self.table.descriptor.least_deviation();
        let fitted =
            Fitted::fit(&zones, &answers, svm, self.params, least, &weighed(self.table, self.params));
        fitted.map_err(|error| match error {
            TrainError::Svm(SvmTrainError::OneClass { examples, converged }) => {
                let without = group.map(str::to_owned);
                TrainError::Alike { without, examples, converged: converged > 0 }
            }
            other => other,
        })
    }

    /// All groups, of zones and of answers.
    fn groups(&self) -> BTreeSet<&'a str> {
        self.zones.iter().map(|z| &*z.group).chain(self.answers.iter().map(|a| &*a.group)).collect()
    }

    /// What a machine that has not seen a group says of it: (decision value, 0 or 1) of each example.
    fn decisions(&self, machine: &Fitted, group: &str) -> Vec<(f32, f64)> {
        let zones = self.zones.iter().filter(|z| z.group == group);
        let answers = self.answers.iter().filter(|a| a.group == group);
        let of_zones = zones.flat_map(|zone| machine.decisions(zone, self.params));
        of_zones.chain(answers.flat_map(|answer| machine.answered(answer))).collect()
    }

    /// The error that says which groups are in no order for machines that have not seen them.
    fn unrelated(&self, svm: SvmParams) -> TrainError {
        let all = self.groups();
        let mut groups = Vec::new();
        for &group in &all {
            match self.fit_without(Some(group), svm) {
                Ok(machine) if order(&self.decisions(&machine, group)) < ORDER => {
                    groups.push(group.to_owned())
                }
                Ok(_) => {}
                Err(error) => return error,
            }
        }
        TrainError::Unrelated { groups, of: all.len() }
    }

    /// Machines that have not seen one group judge that group; one sigmoid is fitted to all of that, and it is said
    /// in what [`order`] it is.
    fn cross_validate(&self, svm: SvmParams) -> Result<(Vec<Fold<'a>>, Sigmoid), TrainError> {
        let (mut folds, mut decisions) = (Vec::new(), Vec::new());
        for group in self.groups() {
            let machine = self.fit_without(Some(group), svm)?;
            decisions.extend(self.decisions(&machine, group));
            let zones = self.zones.iter().copied().filter(|z| z.group == group).collect();
            folds.push(Fold { machine, zones });
        }
        match fit_platt(&decisions) {
            Ok(platt) => Ok((folds, Sigmoid { platt, order: order(&decisions) })),
            Err(SvmTrainError::Platt(_)) => Err(self.unrelated(svm)),
            Err(other) => Err(other.into()),
        }
    }

    /// Predictions with a pair of C and γ for zones whose groups were left out, and the sigmoid of these.
    fn held_out(&self, svm: SvmParams) -> Result<(Vec<Prediction>, Sigmoid), TrainError> {
        let (folds, sigmoid) = self.cross_validate(svm)?;
        let mut predictions: Vec<Prediction> = Vec::new();
        for Fold { machine, zones } in folds {
            let fold = parts(self.table, machine.calibrated(sigmoid.platt), None, TrainingRecord::default());
            predictions.extend(zones.iter().map(|z| predict(|raw| fold.judge(raw), People::DEFAULT, z)));
        }
        Ok((predictions, sigmoid))
    }
}

/// Least [`order`] of what was learned from. Examples whose labels are mixed have one half, give or take 0.05; each group
/// of the human table has 0.96 or more, with both machines.
const ORDER: f64 = 0.6;

/// In how many of all pairs of a noisy and a converged example the converged one has the larger decision value, ties
/// counting one half (Mann and Whitney 1947); 1 if one of the two is missing.
fn order(decisions: &[(f32, f64)]) -> f64 {
    let mut sorted = decisions.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut noisy, mut converged, mut right) = (0.0, 0.0, 0.0);
    for equal in sorted.chunk_by(|a, b| a.0 == b.0) {
        let new = equal.iter().filter(|d| d.1 > 0.5).count() as f64;
        let others = equal.len() as f64 - new;
        right += new * (noisy + 0.5 * others);
        (noisy, converged) = (noisy + others, converged + new);
    }
    if noisy * converged > 0.0 { right / (noisy * converged) } else { 1.0 }
}

/// The numbers that a line weighs, and by how much each grows with ln(samples).
fn weighed(table: &Table, params: &TrainParams) -> Vec<(usize, f64)> {
    let all = table.descriptor.number_names();
    // Far above any floor of noise
    let noisy = vec![3.0f32; all.len()];
    let mut cleaner = noisy.clone();
    table.descriptor.project(&mut cleaner, std::f32::consts::E);
    let growth = |name: &String| {
        let at = all.iter().position(|n| n == name)?;
        Some(f64::from(cleaner[at] - noisy[at]))
    };
    let used = |name: &&String| params.weighed.as_ref().is_none_or(|names| names.contains(name));
    let numbers = table.numbers.iter().enumerate().filter(|(_, name)| used(name));
    numbers.map(|(number, name)| (number, growth(name).unwrap_or(0.0))).collect()
}

/// Predicts the zones of a group, at that share of people, by a model of the zones of `others`; and the C and γ chosen.
pub(crate) fn predict_without(
    table: &Table,
    left_out: &str,
    others: &[&str],
    params: &TrainParams,
    people: People,
) -> Result<(Vec<Prediction>, SvmParams), TrainError> {
    let (classifier, chosen) = fit_groups(table, others, params)?;
    let known = familiarity(table, others, &classifier.scaler);
    let model = parts(table, classifier, known, TrainingRecord::default());
    let zones = table.zones.iter().filter(|z| z.group == left_out);
    Ok((zones.map(|z| predict(|raw| model.judge(raw), people, z)).collect(), chosen))
}

/// Predictions with a pair of C and γ for the zones of `groups`, each group held out in turn.
pub(crate) fn held_out(
    table: &Table,
    groups: &[&str],
    params: &TrainParams,
    svm: SvmParams,
) -> Result<Vec<Prediction>, TrainError> {
    Ok(Material::of(table, groups, params).without_answers().held_out(svm)?.0)
}

/// Trains on the zones of `groups`, at least two, with C and γ chosen, and P calibrated, by leaving each
/// group out in turn.
pub(crate) fn fit_groups(
    table: &Table,
    groups: &[&str],
    params: &TrainParams,
) -> Result<(Classifier, SvmParams), TrainError> {
    let material = Material::of(table, groups, params);

    // Thresholds choose C and γ. Answers are none.
    let zones_only = material.without_answers();
    let outcome = |&svm: &SvmParams| {
        let (predictions, sigmoid) = zones_only.held_out(svm)?;
        Ok((score(predictions.iter()).error_factor, sigmoid))
    };
    let outcomes: Vec<(f64, Sigmoid)> =
        params.candidates.par_iter().map(outcome).collect::<Result<_, TrainError>>()?;
    let best = (0..outcomes.len())
        .min_by(|&i, &j| outcomes[i].0.total_cmp(&outcomes[j].0))
        .ok_or(TrainError::Params)?;
    let chosen = params.candidates[best];

    let sigmoid = outcomes[best].1;
    if sigmoid.order < ORDER || sigmoid.platt.a >= 0.0 {
        return Err(zones_only.unrelated(chosen));
    }

    // All groups train the machine; the sigmoid stays that of held-out decision values.
    let platt =
        if material.answers.is_empty() { sigmoid.platt } else { material.cross_validate(chosen)?.1.platt };
    Ok((material.fit_without(None, chosen)?.calibrated(platt), chosen))
}

/// The parts of a model for tables like this one.
pub(crate) fn parts(
    table: &Table,
    classifier: Classifier,
    familiarity: Option<Familiarity>,
    record: TrainingRecord,
) -> ModelParts {
    ModelParts {
        spread: spread(table, &classifier),
        descriptor: table.descriptor.clone(),
        evidence: table.evidence,
        tone_mapping: table.tone_mapping.clone(),
        viewing: table.viewing,
        classifier,
        familiarity,
        audience: Audience::TRAINED,
        record,
    }
}

/// How the mean thresholds of scenes scatter around what a machine expects: P is a logistic function of ln(samples), as
/// steep as predictions for scenes that were left out are good. `None` if the descriptor does not separate noise from
/// picture, or numbers were taken away from it.
fn spread(table: &Table, classifier: &Classifier) -> Option<Spread> {
    let noisy = &classifier.scaler.mean;
    if noisy.len() != table.descriptor.dimensions() {
        return None;
    }
    // As steep as at the mean of the examples, around the thresholds
    let log_odds = |samples: f32| {
        let mut raw = noisy.clone();
        table.descriptor.project(&mut raw, samples).then(|| {
            let scaled = classifier.scaler.scaled(&raw);
            classifier.platt.log_odds(classifier.machine.decision(&scaled))
        })
    };
    let slope = log_odds(0.5f32.exp())? - log_odds((-0.5f32).exp())?;
    // A curve that does not rise there knows nothing of ln(samples)
    let scenes = if slope > 0.0 { std::f64::consts::PI / 3f64.sqrt() / slope } else { f64::INFINITY };
    Some(Spread { scenes: scenes.clamp(0.01, 10.0), people: Spread::PEOPLE })
}

/// Share of the zones of left-out scenes that are familiar to the others.
const FAMILIAR: f64 = 0.95;

/// What textures the zones of `groups` show, and how far from those of the others the zones of each group
/// lie. `None` if the descriptor does not separate noise from picture.
pub(crate) fn familiarity(table: &Table, groups: &[&str], scaler: &Scaler) -> Option<Familiarity> {
    let texture = table.descriptor.texture();
    if texture.is_empty() {
        return None;
    }
    let mut known: Vec<(&str, Vec<f32>)> = Vec::new();
    for zone in table.zones.iter().filter(|zone| groups.contains(&zone.group.as_str())) {
        let Some(level) = zone.at_threshold() else { continue };
        // A descriptor from which numbers were removed does not say which are left.
        if level.descriptor.len() == table.descriptor.dimensions() {
            let scaled = scaler.scaled(&level.descriptor);
            known.push((&zone.group, texture.iter().map(|&i| scaled[i]).collect()));
        }
    }
    let others = |group| known.iter().filter(move |(of, _)| *of != group).map(|(_, numbers)| numbers);
    let mut distances: Vec<f32> =
        known.iter().map(|(group, numbers)| nearest(others(*group), numbers)).collect();
    distances.sort_by(f32::total_cmp);
    let within = (FAMILIAR * distances.len() as f64).ceil() as usize;
    let reach = *distances.get(within.checked_sub(1)?)?;
    Some(Familiarity { zones: known.into_iter().map(|(_, numbers)| numbers).collect(), reach })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_of_examples_is_that_of_their_pairs() {
        let examples = [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (2.0, 1.0)];
        // Of 2 × 2 pairs, three are right and one is a tie
        assert_eq!(order(&examples), 3.5 / 4.0);
        assert_eq!(order(&examples.map(|(decision, converged)| (-decision, converged))), 0.5 / 4.0);
        assert_eq!((order(&[]), order(&[(3.0, 1.0)])), (1.0, 1.0));
    }
}
