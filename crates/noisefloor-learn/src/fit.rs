//! Choosing C and γ, and calibrating P, by leaving groups of scenes out.

use crate::answer::Answer;
use crate::machine::Machine;
use crate::params::{TrainError, TrainParams};
use crate::predict::{Prediction, predict};
use crate::score::score;
use crate::table::{Table, Zone};
use noisefloor::{
    DEFAULT_THRESHOLD, Familiarity, Platt, Scaler, SvmParams, TrainingRecord, fit_platt, nearest,
};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Trains on the zones of `groups`, at least two, with C and γ chosen, and P calibrated, by leaving each group out in turn.
pub(crate) fn fit_groups(
    table: &Table,
    groups: &[&str],
    params: &TrainParams,
) -> Result<(Machine, Platt, SvmParams), TrainError> {
    let of = |wanted: &dyn Fn(&str) -> bool| -> Vec<&Zone> {
        table.zones.iter().filter(|z| groups.contains(&z.group.as_str()) && wanted(&z.group)).collect()
    };
    let all = table.groups();
    let known = |a: &&Answer| groups.contains(&a.group.as_str()) || !all.contains(&a.group.as_str());
    let answers: Vec<&Answer> = table.answers.iter().filter(known).collect();
    let fit = |wanted: &dyn Fn(&str) -> bool, answers: &[&Answer], svm: SvmParams| {
        let told: Vec<&Answer> = answers.iter().copied().filter(|a| wanted(&a.group)).collect();
        Machine::fit((&of(wanted), &told), svm, params.range, table.descriptor.least_deviation())
    };

    // Machines that have not seen one group judge that group; one sigmoid over all of it.
    let folds = |svm: SvmParams, answers: &[&Answer]| -> Result<_, TrainError> {
        let mut folds = Vec::new();
        let mut decisions = Vec::new();
        let everyone: BTreeSet<&str> =
            groups.iter().copied().chain(answers.iter().map(|a| a.group.as_str())).collect();
        for group in everyone {
            let machine = fit(&|g| g != group, answers, svm)?;
            let zones = of(&|g| g == group);
            zones.iter().for_each(|z| decisions.extend(machine.decisions(z, params)));
            let asked = answers.iter().filter(|a| a.group == group);
            asked.for_each(|a| decisions.extend(machine.answered(a)));
            folds.push((machine, zones));
        }
        Ok((folds, fit_platt(&decisions)?))
    };

    // Thresholds choose C and γ. Answers are none.
    let held_out = |&candidate: &SvmParams| -> Result<(f64, Platt), TrainError> {
        let (folds, platt) = folds(candidate, &[])?;
        let record = TrainingRecord::default();
        let predictions: Vec<Prediction> = folds
            .into_iter()
            .flat_map(|(machine, zones)| {
                let model = machine.into_model(table, platt, None, record.clone());
                zones.into_iter().map(|z| predict(&model, DEFAULT_THRESHOLD, z)).collect::<Vec<_>>()
            })
            .collect();
        Ok((score(predictions.iter()).error_factor, platt))
    };
    let outcomes: Vec<(f64, Platt)> = params.candidates.par_iter().map(held_out).collect::<Result<_, _>>()?;
    let best = (0..outcomes.len())
        .min_by(|&i, &j| outcomes[i].0.total_cmp(&outcomes[j].0))
        .ok_or(TrainError::Params)?;

    // All groups train the machine; the sigmoid stays that of held-out decision values.
    let chosen = params.candidates[best];
    let platt = if answers.is_empty() { outcomes[best].1 } else { folds(chosen, &answers)?.1 };
    Ok((fit(&|_| true, &answers, chosen)?, platt, chosen))
}

/// Share of the zones of left-out scenes that are familiar to the others.
const FAMILIAR: f64 = 0.95;

/// What pictures the zones of `groups` show, and how far from those of the others the zones of each group lie. `None` if the
/// descriptor does not tell noise from picture.
pub(crate) fn familiarity(table: &Table, groups: &[&str], scaler: &Scaler) -> Option<Familiarity> {
    let whole = table.descriptor.len();
    if table.descriptor.texture_numbers() == 0 {
        return None;
    }
    let known: Vec<(&str, Vec<f32>)> = table
        .zones
        .iter()
        .filter(|zone| groups.contains(&zone.group.as_str()))
        .filter_map(|zone| {
            // A descriptor of which numbers were taken away does not say which are left.
            let mut numbers = zone.at_threshold()?.descriptor.clone();
            (numbers.len() == whole).then(|| {
                scaler.apply(&mut numbers);
                (zone.group.as_str(), table.descriptor.texture_of(&numbers))
            })
        })
        .collect();
    let others = |group| known.iter().filter(move |(of, _)| *of != group).map(|(_, numbers)| numbers);
    let mut distances: Vec<f32> =
        known.iter().map(|(group, numbers)| nearest(others(*group), numbers)).collect();
    distances.sort_by(f32::total_cmp);
    let within = (FAMILIAR * distances.len() as f64).ceil() as usize;
    let reach = *distances.get(within.checked_sub(1)?)?;
    Some(Familiarity { zones: known.into_iter().map(|(_, numbers)| numbers).collect(), reach })
}
