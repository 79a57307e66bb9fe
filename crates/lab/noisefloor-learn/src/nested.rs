//! Scores of a way to choose, not of one choice.

use crate::choices::Choice;
use crate::fit::{held_out, predict_without};
use crate::params::{TrainError, TrainParams};
use crate::predict::Prediction;
use crate::score::score;
use noisefloor::People;
use noisefloor::svm::SvmParams;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeSet;

/// What was chosen without a group of scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Chosen {
    pub without: String,
    /// [`Choice::name`].
    pub choice: String,
    pub c: f64,
    pub gamma: f64,
    /// Error factor of the choice on the other groups, each held out from a machine in turn.
    pub error_factor: f64,
}

/// Predicts every zone with everything chosen without its group: first one of the choices, by its error on the
/// other groups, with each of them held out in turn (with the candidate of C and γ in the middle): the first one that
/// is worse than the best by no more than the standard error of their difference over groups (Breiman et al. 1984,
/// "Classification and Regression Trees", §3.4.3), so that choices are to be given with what is to stay first. Then C, γ
/// and the calibration of P, in the same way. `on_fold` is called before each group with its name.
pub fn choose_and_leave_out(
    choices: &[Choice],
    params: &TrainParams,
    people: People,
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
            let of_group = |group: &&str| {
                let scenes: BTreeSet<&str> = choice
                    .table
                    .zones
                    .iter()
                    .filter(|z| z.group == *group)
                    .map(|z| z.scene.as_str())
                    .collect();
                score(predictions.iter().filter(|p| scenes.contains(p.scene.as_str()))).error_factor.ln()
            };
            let by_group: Vec<f64> = others.iter().map(of_group).collect();
            Ok((score(predictions.iter()).error_factor, by_group))
        };
        let errors: Vec<(f64, Vec<f64>)> =
            choices.par_iter().map(error).collect::<Result<_, TrainError>>()?;
        let best = chosen_of(&errors).ok_or(TrainError::Params)?;
        let Choice { name, table } = &choices[best];

        let (predicted, SvmParams { c, gamma }) = predict_without(table, left_out, &others, params, people)?;
        predictions.extend(predicted);
        let (without, choice, error_factor) = (left_out.to_owned(), name.clone(), errors[best].0);
        all_chosen.push(Chosen { without, choice, c, gamma, error_factor });
    }
    Ok((predictions, all_chosen))
}

/// The first of the choices, with their errors over all zones and by group, that is not worse than the best by more than
/// one standard error.
fn chosen_of(errors: &[(f64, Vec<f64>)]) -> Option<usize> {
    let best = errors.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let as_good = |(_, by_group): &(f64, Vec<f64>)| {
        let differences: Vec<f64> = by_group.iter().zip(&best.1).map(|(one, best)| one - best).collect();
        let n = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / n;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0);
        mean <= (variance / n).sqrt()
    };
    errors.iter().position(as_good)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_as_good_as_the_best_stays() {
        let scored = |error: f64, by_group: [f64; 4]| (error, by_group.to_vec());
        let best = scored(1.2, [0.1, 0.2, 0.2, 0.2]);
        // Worse by 0.05 on average, in one group by much, in the others not at all: 0.05 is its standard error
        let nearly = scored(1.25, [0.3, 0.2, 0.2, 0.2]);
        // Worse by 0.04 everywhere
        let worse = scored(1.24, [0.14, 0.24, 0.24, 0.24]);
        assert_eq!(chosen_of(&[worse.clone(), nearly.clone(), best.clone()]), Some(1));
        assert_eq!(chosen_of(&[worse.clone(), best.clone(), nearly]), Some(1));
        assert_eq!(chosen_of(&[worse, best]), Some(1));
        assert_eq!(chosen_of(&[]), None);
    }
}
