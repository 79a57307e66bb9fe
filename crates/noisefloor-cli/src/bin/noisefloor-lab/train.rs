//! `noisefloor-lab train`.

mod disagreements;
mod say;

use crate::args::{TrainArgs, check_data};
use crate::learning::held_out;
use noisefloor::People;
use noisefloor_cli::say::note;
use noisefloor_image::{check_writable, write_atomic};
use noisefloor_learn::{score, train, write_table};
use say::{say_model, say_scores};

pub fn run(args: TrainArgs) -> anyhow::Result<()> {
    let TrainArgs { data, search, out, save_table, save_choices, disagreements, no_scores } = args;
    let (data, search) = check_data(data, search)?;
    for path in save_table.iter().chain(&save_choices).chain([&out]) {
        check_writable(path)?;
    }
    if let Some(path) = &save_choices {
        let table = data.load_choices()?;
        write_atomic(path, |to| write_table(&table, to))?;
        note!("numbers for every choice written to {}", path.display());
    }
    let table = data.load()?;
    if let Some(path) = &save_table {
        write_atomic(path, |to| write_table(&table, to))?;
        note!("table of {} zones written to {}", table.zones.len(), path.display());
    }
    let params = search.params(&table);
    if let Some(database) = &disagreements {
        return disagreements::run(&data, &out, &table, &params, database);
    }

    // Scores on scenes left out, where there are enough to leave one out and still choose among the others.
    let scores = if no_scores || table.groups().len() < 3 {
        None
    } else {
        let predictions = held_out(&table, &params, People::DEFAULT)?;
        Some(score(predictions.iter()))
    };
    note!("training on all scenes");
    let model = train(&table, &params, data.origin(), scores)?;
    write_atomic(&out, |to| model.write(to))?;
    say_model(&model, &out)?;
    scores.map_or(Ok(()), |scores| say_scores("", scores))?;
    Ok(())
}
