//! Scores of a way to choose, not of one choice.

use crate::choices::Choice;
use crate::fit::{familiarity, fit_groups, held_out, parts};
use crate::params::{TrainError, TrainParams};
use crate::predict::{Prediction, predict};
use crate::score::score;
use noisefloor::{People, model::TrainingRecord, svm::SvmParams};
use rayon::prelude::*;
use serde::Serialize;

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
/// and the calibration of P, in the same way. `on_fold` is called before each group with its name.
///
/// # Errors
/// [`TrainError`] if there are no choices, fewer than four groups, or training fails.
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
            Ok(score(predictions.iter()).error_factor)
        };
        let errors: Vec<f64> = choices.par_iter().map(error).collect::<Result<_, TrainError>>()?;
        let best =
            (0..errors.len()).min_by(|&i, &j| errors[i].total_cmp(&errors[j])).ok_or(TrainError::Params)?;
        let Choice { name, table } = &choices[best];

        let (classifier, SvmParams { c, gamma }) = fit_groups(table, &others, params)?;
        let known = familiarity(table, &others, &classifier.scaler);
        let model = parts(table, classifier, known, TrainingRecord::default());
        let zones = table.zones.iter().filter(|z| z.group == left_out);
        predictions.extend(zones.map(|z| predict(|raw| model.judge(raw), people, z)));
        let (without, choice, error_factor) = (left_out.to_owned(), name.clone(), errors[best]);
        all_chosen.push(Chosen { without, choice, c, gamma, error_factor });
    }
    Ok((predictions, all_chosen))
}
