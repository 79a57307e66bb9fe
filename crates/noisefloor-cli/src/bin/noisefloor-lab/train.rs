//! `noisefloor-lab train`.

mod disagreements;
mod say;

use crate::learning::{DataJob, SearchJob, held_out};
use noisefloor::People;
use noisefloor_cli::say::note;
use noisefloor_image::{check_writable, write_atomic};
use noisefloor_learn::{score, train, write_table};
use say::{say_model, say_scores};
use std::path::PathBuf;

/// What to train on, and how: checked.
pub struct TrainJob {
    pub data: DataJob,
    pub search: SearchJob,
    pub out: PathBuf,
    pub save_table: Option<PathBuf>,
    pub save_choices: Option<PathBuf>,
    pub disagreements: Option<PathBuf>,
    pub scores: bool,
}

pub fn run(job: &TrainJob) -> anyhow::Result<()> {
    for path in job.save_table.iter().chain(&job.save_choices).chain([&job.out]) {
        check_writable(path)?;
    }
    if let Some(path) = &job.save_choices {
        let table = job.data.load_choices()?;
        write_atomic(path, |to| write_table(&table, to))?;
        note!("numbers for every choice written to {}", path.display());
    }
    let table = job.data.load()?;
    if let Some(path) = &job.save_table {
        write_atomic(path, |to| write_table(&table, to))?;
        note!("table of {} zones written to {}", table.zones.len(), path.display());
    }
    let params = job.search.params(&table);
    if let Some(database) = &job.disagreements {
        return disagreements::run(&job.data, &job.out, &table, &params, database);
    }

    // Scores on scenes left out, where there are enough to leave one out and still choose among the others.
    let scores = if !job.scores || table.groups().len() < 3 {
        None
    } else {
        let predictions = held_out(&table, &params, People::DEFAULT)?;
        Some(score(predictions.iter()))
    };
    note!("training on all scenes");
    let model = train(&table, &params, job.data.origin(), scores)?;
    write_atomic(&job.out, |to| model.write(to))?;
    say_model(&model, &job.out)?;
    scores.map_or(Ok(()), |scores| say_scores("", scores))?;
    Ok(())
}
