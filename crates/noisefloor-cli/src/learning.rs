//! What `train` and `evaluate` share: human thresholds, and predictions for scenes left out.

use crate::bars::bar;
use anyhow::Context;
use noisefloor::{Descriptor, Evidence, Threshold, Viewing};
use noisefloor_learn::{
    Corpora, Prediction, Table, TrainParams, describe_corpora, leave_one_scene_out, read_table,
};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Human thresholds, and how zones are described where a table does not say.
pub struct DataJob {
    pub source: DataSource,
    pub descriptor: Descriptor,
    pub evidence: Evidence,
    /// Where people are taken to have seen the pictures.
    pub viewing: Viewing,
}

pub enum DataSource {
    Corpora(Vec<PathBuf>),
    Table(PathBuf),
}

impl DataJob {
    /// The table: read, or computed from pictures.
    pub fn load(&self) -> anyhow::Result<Table> {
        let folders = match &self.source {
            DataSource::Table(path) => return read_table_file(path),
            DataSource::Corpora(folders) => folders,
        };
        let bar = bar(0, "zones described");
        let corpora = Corpora { viewing: self.viewing, ..Corpora::new(folders) };
        let table = describe_corpora(corpora, &self.descriptor, self.evidence, |done, all| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
        })?;
        bar.finish_and_clear();
        Ok(table)
    }

    /// The corpora; none if there is a table.
    #[cfg(feature = "lab")]
    pub fn corpora(&self) -> &[PathBuf] {
        match &self.source {
            DataSource::Corpora(folders) => folders,
            DataSource::Table(_) => &[],
        }
    }

    /// Where it comes from, for the record of a model.
    pub fn origin(&self) -> String {
        match &self.source {
            DataSource::Table(path) => path.display().to_string(),
            DataSource::Corpora(folders) => {
                folders.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ")
            }
        }
    }
}

/// A table that `train --save-table` wrote.
pub fn read_table_file(path: &Path) -> anyhow::Result<Table> {
    let file = File::open(path).with_context(|| format!("{}: cannot be opened", path.display()))?;
    read_table(BufReader::new(file)).with_context(|| format!("{}", path.display()))
}

/// Predictions on left-out scenes, with a bar.
pub fn held_out(
    table: &Table,
    params: &TrainParams,
    threshold: Threshold,
) -> anyhow::Result<Vec<Prediction>> {
    let bar = bar(table.groups().len() as u64, "scenes left out");
    let mut begun = false;
    let predictions = leave_one_scene_out(table, params, threshold, |group| {
        if begun {
            bar.inc(1);
        }
        begun = true;
        bar.set_message(group.to_owned());
    })?;
    bar.finish_and_clear();
    Ok(predictions)
}
