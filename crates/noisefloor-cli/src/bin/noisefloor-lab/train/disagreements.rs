//! Training on a table and on what people said against verdicts.

use super::say::{say_model, say_scores};
use crate::learning::DataJob;
use anyhow::bail;
use noisefloor::{Model, People};
use noisefloor_cli::bars::bar;
use noisefloor_cli::say::{note, say};
use noisefloor_image::write_atomic;
use noisefloor_learn::{Table, TrainParams};
use noisefloor_study::explore::{AnswerAgreement, LearnStep, read_answers, retrain};
use std::path::Path;

/// Trains, and says what the answers have changed.
pub(super) fn run(
    data: &DataJob,
    out: &Path,
    table: &Table,
    params: &TrainParams,
    database: &Path,
) -> anyhow::Result<()> {
    let all = read_answers(database)?;
    let fitting = all.iter().filter(|d| d.said.fits(&table.descriptor, table.evidence));
    let answers: Vec<_> = fitting.map(|d| d.said.answer()).collect();
    if answers.is_empty() {
        bail!(
            "{}: none of {} disagreements was described as the table is; disagree with a verdict in `noisefloor-lab explore`, or train without --disagreements",
            database.display(),
            all.len()
        );
    }
    if answers.len() < all.len() {
        note!(
            "note: {} of {} disagreements were described differently from the table, and are ignored",
            all.len() - answers.len(),
            all.len()
        );
    }
    let bar = bar(0, "parts");
    let on_step = |step: LearnStep| {
        bar.set_length(step.of as u64);
        bar.set_position(step.done as u64);
        bar.set_message(step.doing);
    };
    let base = (&Model::bundled(), People::DEFAULT);
    let (model, learned) = retrain(table, answers, params, base, &data.origin(), on_step)?;
    bar.finish_and_clear();
    write_atomic(out, |to| model.write(to))?;
    say_model(&model, out)?;
    if let (Some(before), Some(after)) = (learned.before, learned.after) {
        say_scores("before ", before)?;
        say_scores("after  ", after)?;
    }
    let AnswerAgreement { of, before, fitted, left_out } = learned.agreement;
    say!(
        "of {of} disagreements, the verdict is right for {before} before, {fitted} after, and {left_out} after with their scene left out"
    )?;
    if !learned.worse.is_empty() {
        say!("people's thresholds are predicted worse now: {}", learned.worse.join("; "))?;
    }
    Ok(())
}
