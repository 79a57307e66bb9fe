//! Scores of a way to choose, not of one choice.

use crate::choices::Choice;
use crate::fit::{familiarity, fit_groups, held_out, parts};
use crate::params::{TrainError, TrainParams};
use crate::predict::{Prediction, predict};
use crate::table::Table;
use noisefloor::{SvmParams, Threshold, TrainingRecord};
use rayon::prelude::*;
use serde::Serialize;
use statrs::statistics::Statistics;
use std::collections::BTreeMap;

/// What was chosen without a group of scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Chosen {
    /// The group.
    pub without: String,
    /// [`Choice::name`].
    pub choice: String,
    /// C of the machine.
    pub c: f64,
    /// γ of the machine.
    pub gamma: f64,
    /// Error factor of the choice on the other groups, each held out from a machine in turn.
    pub error_factor: f64,
}

/// Predicts every zone with everything chosen without its group: first one of the choices, by its error on the
/// other groups, with each of them held out in turn (with the candidate of C and γ in the middle); then C, γ
/// and the calibration of P, in the same way. Of all choices within one standard error over groups of the best one,
/// those with least to learn are taken, and of these the best. `on_fold` is called before each group with its name.
///
/// # Errors
/// [`TrainError`] if there are no choices, fewer than four groups, or training fails.
pub fn choose_and_leave_out(
    choices: &[Choice],
    params: &TrainParams,
    threshold: Threshold,
    mut on_fold: impl FnMut(&str),
) -> Result<(Vec<Prediction>, Vec<Chosen>), TrainError> {
    let first = &choices.first().ok_or(TrainError::Params)?.table;
    let middle = *params.candidates.get(params.candidates.len() / 2).ok_or(TrainError::Params)?;
    let groups = first.groups();
    if groups.len() < 4 {
        return Err(TrainError::Groups { needed: 4, found: groups.len(), names: groups.join(", ") });
    }
    let (mut predictions, mut all_chosen) = (Vec::new(), Vec::new());
    for &left_out in &groups {
        on_fold(left_out);
        let others: Vec<&str> = groups.iter().copied().filter(|&g| g != left_out).collect();
        let error = |choice: &Choice| {
            let predictions = held_out(&choice.table, &others, params, middle)?;
            Ok(group_errors(&predictions, &choice.table))
        };
        let errors: Vec<Vec<f64>> = choices.par_iter().map(error).collect::<Result<_, TrainError>>()?;
        let chosen = simplest(choices, &errors).ok_or(TrainError::Params)?;
        let Choice { name, table, .. } = &choices[chosen];

        let (classifier, SvmParams { c, gamma }) = fit_groups(table, &others, params)?;
        let known = familiarity(table, &others, &classifier.scaler);
        let model = parts(table, classifier, known, TrainingRecord::default());
        let zones = table.zones.iter().filter(|z| z.group == left_out);
        predictions.extend(zones.map(|z| predict(|raw| model.judge(raw), threshold, z)));
        let (without, choice, error_factor) =
            (left_out.to_owned(), name.clone(), errors[chosen].as_slice().mean().exp());
        all_chosen.push(Chosen { without, choice, c, gamma, error_factor });
    }
    Ok((predictions, all_chosen))
}

/// The mean of |ln(predicted/human)| over the zones of each group, in the order of the groups.
fn group_errors(predictions: &[Prediction], table: &Table) -> Vec<f64> {
    let group_of: BTreeMap<&str, &str> = table.zones.iter().map(|z| (&*z.scene, &*z.group)).collect();
    let mut groups: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for p in predictions.iter().filter(|p| !p.censored) {
        groups.entry(group_of[p.scene.as_str()]).or_default().push(p.log_ratio().abs());
    }
    groups.into_values().map(|errors| errors.as_slice().mean()).collect()
}

/// The choice with least to learn that is not worse than the best one by more than one standard error, over groups, of
/// what it is worse by; of several the best.
fn simplest(choices: &[Choice], errors: &[Vec<f64>]) -> Option<usize> {
    let best = errors.iter().min_by(|a, b| a.as_slice().mean().total_cmp(&b.as_slice().mean()))?;
    let as_good = |errors: &[f64]| {
        let worse: Vec<f64> = errors.iter().zip(best).map(|(error, best)| error - best).collect();
        let mean = worse.as_slice().mean();
        mean <= worse.as_slice().std_dev() / (worse.len() as f64).sqrt()
    };
    // The best one is as good as itself, though nothing scatters
    let enough = (0..errors.len()).filter(|&i| std::ptr::eq(&errors[i], best) || as_good(&errors[i]));
    enough.min_by(|&i, &j| {
        let (a, b) = (choices[i].learned, choices[j].learned);
        a.cmp(&b).then(errors[i].as_slice().mean().total_cmp(&errors[j].as_slice().mean()))
    })
}
