//! `noisefloor-lab evaluate`.

mod rivals;
mod tables;

use crate::learning::{DataJob, SearchJob, chosen_and_held_out, held_out};
use anyhow::{anyhow, bail};
use noisefloor::{Model, People};
use noisefloor_cli::files::write_json;
use noisefloor_cli::say::say;
use noisefloor_image::{check_writable, write_csv};
use noisefloor_lab::figures::write_figures;
use noisefloor_lab::rivals::RatedRival;
use noisefloor_learn::{Chosen, Evaluation, Prediction, Table, TrainParams, predict};
use noisefloor_rivals::Rival;
use serde::Serialize;
use std::path::PathBuf;

pub struct EvaluateJob {
    pub data: DataJob,
    pub search: SearchJob,
    /// None to leave out one scene after the other.
    pub model: Option<Model>,
    pub people: People,
    pub json: Option<PathBuf>,
    pub csv: Option<PathBuf>,
    pub figures: Option<PathBuf>,
    pub without: Vec<String>,
    /// Whether everything is chosen without the scene that is predicted.
    pub nested: bool,
    pub rivals: Vec<&'static Rival>,
}

/// What `--json` writes.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    evaluation: Evaluation,
    /// What was chosen without each group of scenes, with `--nested`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    choices: Vec<Chosen>,
    /// Other criteria on the same zones, if `--rivals` asked for them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    rivals: Vec<RatedRival>,
}

pub fn run(job: &EvaluateJob) -> anyhow::Result<()> {
    for path in job.json.iter().chain(&job.csv) {
        check_writable(path)?;
    }
    let table = if job.nested { job.data.load_choices()? } else { table(job)? };
    let params = job.search.params(&table);
    let Predicted { by, predictions, choices } = predict_zones(job, &table, &params)?;
    let rivals = rivals::rate(&job.data, &job.rivals)?;
    let report = Report { evaluation: Evaluation::new(by, &table, &predictions), choices, rivals };
    if let Some(path) = &job.json {
        write_json(path, &report)?;
    }
    if let Some(path) = &job.csv {
        write_csv(path, predictions.iter())?;
    }
    if let Some(folder) = &job.figures {
        write_figures(folder, job.data.corpora(), &predictions, &report.evaluation.reliability)?;
        rivals::draw(folder, &predictions, &report.rivals)?;
    }
    tables::say_scores(&report.evaluation)?;
    tables::say_choices(&report.choices)?;
    if !report.rivals.is_empty() {
        rivals::say_rated(&predictions, &report.rivals)?;
    }
    say_caveats(job, &table)
}

/// Predictions of the zones of a table.
struct Predicted {
    by: String,
    predictions: Vec<Prediction>,
    choices: Vec<Chosen>,
}

/// The table without the numbers that are left out.
fn table(job: &EvaluateJob) -> anyhow::Result<Table> {
    let table = job.data.load()?;
    let names = table.descriptor.number_names().join(", ");
    table
        .without(&job.without)
        .map_err(|name| anyhow!("--without {name}: the numbers of the table are {names}"))
}

/// Who predicts, and what.
fn predict_zones(job: &EvaluateJob, table: &Table, params: &TrainParams) -> anyhow::Result<Predicted> {
    if job.nested {
        let (predictions, choices) = chosen_and_held_out(table, params, job.people)?;
        return Ok(Predicted { by: "nested leave-one-scene-out".to_owned(), predictions, choices });
    }
    let Some(model) = &job.model else {
        let predictions = held_out(table, params, job.people)?;
        return Ok(Predicted { by: "leave-one-scene-out".to_owned(), predictions, choices: Vec::new() });
    };
    if (model.descriptor(), model.evidence()) != (&table.descriptor, table.evidence) {
        bail!(
            "the model uses the {} descriptor {:?} with {:?} as evidence, the table {:?} with {:?}",
            model.descriptor().name(),
            model.descriptor(),
            model.evidence(),
            table.descriptor,
            table.evidence
        );
    }
    let predictions = table.zones.iter().map(|z| predict(|raw| model.judge(raw), job.people, z)).collect();
    Ok(Predicted { by: model.digest(), predictions, choices: Vec::new() })
}

/// What flatters a number stands beside it.
fn say_caveats(job: &EvaluateJob, table: &Table) -> anyhow::Result<()> {
    let scenes = table.scenes();
    let trained_on = job.model.iter().flat_map(|model| &model.record().scenes);
    let seen: Vec<&str> = trained_on.map(String::as_str).filter(|scene| scenes.contains(scene)).collect();
    if !seen.is_empty() {
        say!("Note: the model was trained on these scenes: {}.", seen.join(", "))?;
    }
    if table.groups().len() == 1 {
        say!("Note: with one group of scenes, the constant is fitted to the very zones it predicts.")?;
    }
    Ok(())
}
