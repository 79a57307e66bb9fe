//! Retraining on disagreements, and what that costs and gains.

use noisefloor::{Model, People, model::Scores};
use noisefloor_learn::{Answer, TrainError, TrainParams, leave_answers_out, leave_one_scene_out, train};
use noisefloor_learn::{Table, score};
use serde::Serialize;

/// Number of answers that models agree with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct AnswerAgreement {
    pub of: usize,
    /// Agreements of the model trained only on the table.
    pub before: usize,
    /// Agreements of the model trained on these answers as well: how well they are fitted, not how well it
    /// generalises.
    pub fitted: usize,
    /// Agreements of models trained without the answers about the same scene.
    pub left_out: usize,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Learned {
    /// Leave-one-scene-out scores on the table, trained only on the table. `None` if it has too few groups
    /// of scenes.
    pub before: Option<Scores>,
    /// The same, trained on the disagreements as well.
    pub after: Option<Scores>,
    pub agreement: AnswerAgreement,
    /// Scenes that the disagreements are about.
    pub scenes: Vec<String>,
    /// Which scores got worse, in words; empty if none did.
    pub worse: Vec<String>,
    /// Digest of the new model.
    pub model: String,
}

#[derive(Clone, Debug, Serialize)]
pub struct LearnStep {
    pub done: usize,
    pub of: usize,
    /// The step that starts now.
    pub doing: String,
}

/// Trains on a table together with answers, and scores both. Half of the work is skipped if `model` was
/// trained on this table and holds its scores. An answer agrees if the verdict for that share of people is the
/// same. Deterministic.
pub fn retrain(
    table: &Table,
    answers: Vec<Answer>,
    params: &TrainParams,
    (model, share): (&Model, People),
    corpus: &str,
    mut on_step: impl FnMut(LearnStep),
) -> Result<(Model, Learned), TrainError> {
    let plain = Table { answers: Vec::new(), ..table.clone() };
    let told = Table { answers, ..plain.clone() };
    let (groups, scenes) = (plain.groups().len(), told.answer_groups().len());
    let known = Some(model).filter(|m| {
        m.record().table_digest == plain.digest() && *params == TrainParams::for_descriptor(&plain.descriptor)
    });
    let scored = groups >= 3;
    let known_scores = known.and_then(|m| m.record().leave_one_scene_out);
    let folds = if scored { groups } else { 0 };
    let of = folds * (1 + usize::from(known_scores.is_none())) + usize::from(known.is_none()) + scenes + 1;
    let mut done = 0;
    let mut step = |doing: String| {
        on_step(LearnStep { done, of, doing });
        done += 1;
    };

    let mut people = |table: &Table, what: &str| -> Result<Option<Scores>, TrainError> {
        if !scored {
            return Ok(None);
        }
        let on_fold = |group: &str| step(format!("{what}: {group} left out"));
        let predictions = leave_one_scene_out(table, params, People::DEFAULT, on_fold)?;
        Ok(Some(score(predictions.iter())))
    };
    let before = match known_scores {
        Some(scores) => Some(scores),
        None => people(&plain, "before")?,
    };
    let after = people(&told, "after")?;
    let base = match known {
        Some(model) => model.clone(),
        None => {
            step("only the table".into());
            train(&plain, params, String::new(), None)?
        }
    };
    let left_out = leave_answers_out(&told, params, |scene| step(format!("your answers: {scene} left out")))?;
    step("the new model".into());
    let corpus = format!(
        "{corpus}, and {} answers about tiles of {}",
        told.answers.len(),
        told.answer_groups().join(", ")
    );
    let new = train(&told, params, corpus, after)?;

    let agreement = agreement(&told.answers, share, [&base, &new], &left_out);
    let scenes = told.answer_groups().into_iter().map(str::to_owned).collect();
    let worse = worse(before, after);
    let learned = Learned { before, after, agreement, scenes, worse, model: new.digest() };
    Ok((new, learned))
}

/// Answers that the model before, the one after, and those that left the scene out agree with.
fn agreement(
    answers: &[Answer],
    people: People,
    [before, after]: [&Model; 2],
    left_out: &[f32],
) -> AnswerAgreement {
    let agree = |p: &dyn Fn(usize, &Answer) -> f32| {
        answers.iter().enumerate().filter(|(i, a)| a.agrees(p(*i, a), people)).count()
    };
    AnswerAgreement {
        of: answers.len(),
        before: agree(&|_, a| a.probability(before)),
        fitted: agree(&|_, a| a.probability(after)),
        left_out: agree(&|i, _| left_out[i]),
    }
}

/// Scores that got worse by more than rounding.
fn worse(before: Option<Scores>, after: Option<Scores>) -> Vec<String> {
    let (Some(before), Some(after)) = (before, after) else { return Vec::new() };
    let mut worse = Vec::new();
    if after.error_factor > before.error_factor + 0.0005 {
        worse.push(format!(
            "the error factor rises from ×{:.3} to ×{:.3}",
            before.error_factor, after.error_factor
        ));
    }
    if after.early_share > before.early_share + 0.0005 {
        let [from, to] = [before, after].map(|s| 100.0 * s.early_share);
        worse.push(format!("{to:.1} % of zones are stopped too early, and were {from:.1} %"));
    }
    let off = |s: Scores| s.bias_factor.ln().abs();
    if off(after) > off(before) + 0.005 {
        worse.push(format!("the bias goes from ×{:.2} to ×{:.2}", before.bias_factor, after.bias_factor));
    }
    worse
}
