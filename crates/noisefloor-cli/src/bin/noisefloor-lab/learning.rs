//! What `train` and `evaluate` share: human thresholds, and predictions for scenes left out.

use anyhow::Context;
use indicatif::ProgressBar;
use noisefloor::{
    People, Viewing,
    descriptor::{Descriptor, DescriptorSpec},
    evidence::Evidence,
};
use noisefloor_cli::bars::bar;
use noisefloor_learn::{
    Chosen, Corpora, Learner, Prediction, SvmParams, Table, TrainParams, VISIBLE_CHOICES, choices,
    choose_and_leave_out, describe_corpora, leave_one_scene_out, read_table, read_table_with,
};
use std::collections::BTreeMap;
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

/// How to train, where the table leaves a choice.
pub struct SearchJob {
    /// By default what serves the table's descriptor.
    pub learner: Option<Learner>,
    /// Values of C to choose from; those of the learner if there are none.
    pub c: Vec<f64>,
    /// The same of γ.
    pub gamma: Vec<f64>,
}

impl SearchJob {
    /// How to train on a table.
    pub fn params(&self, table: &Table) -> TrainParams {
        let mut params = match self.learner {
            Some(Learner::Line) => TrainParams::default(),
            Some(Learner::Svm) => TrainParams::svm(),
            None => TrainParams::for_descriptor(&table.descriptor),
        };
        let given = |values: &[f64], default: fn(&SvmParams) -> f64| -> Vec<f64> {
            if !values.is_empty() {
                return values.to_vec();
            }
            let mut all: Vec<f64> = params.candidates.iter().map(default).collect();
            all.sort_by(f64::total_cmp);
            all.dedup();
            all
        };
        let (cs, gammas) = (given(&self.c, |p| p.c), given(&self.gamma, |p| p.gamma));
        params.candidates =
            cs.iter().flat_map(|&c| gammas.iter().map(move |&gamma| SvmParams { c, gamma })).collect();
        params
    }
}

pub enum DataSource {
    Corpora(Vec<PathBuf>),
    Table(PathBuf),
}

impl DataJob {
    /// The table: read, or computed from pictures.
    pub fn load(&self) -> anyhow::Result<Table> {
        match &self.source {
            DataSource::Table(path) => read_table_file(path),
            DataSource::Corpora(folders) => self.describe(folders, &self.descriptor),
        }
    }

    /// The table with numbers for every choice of constants: read, or computed from pictures.
    pub fn load_choices(&self) -> anyhow::Result<Table> {
        match &self.source {
            DataSource::Table(path) => {
                let table = read_table_with(open(path)?, &[VISIBLE_CHOICES]);
                table.with_context(|| format!("{}", path.display()))
            }
            DataSource::Corpora(folders) => {
                let (name, parameters) = (VISIBLE_CHOICES.name.to_owned(), BTreeMap::new());
                let spec = DescriptorSpec { name, parameters };
                self.describe(folders, &Descriptor::from_spec(&spec, &[VISIBLE_CHOICES])?)
            }
        }
    }

    fn describe(&self, folders: &[PathBuf], descriptor: &Descriptor) -> anyhow::Result<Table> {
        let bar = bar(0, "zones described");
        let corpora = Corpora { viewing: self.viewing, ..Corpora::new(folders) };
        let table = describe_corpora(corpora, descriptor, self.evidence, |done, all| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
        })?;
        bar.finish_and_clear();
        Ok(table)
    }

    /// The corpora; none if there is a table.
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
    read_table(open(path)?).with_context(|| format!("{}", path.display()))
}

fn open(path: &Path) -> anyhow::Result<BufReader<File>> {
    let file = File::open(path).with_context(|| format!("{}: cannot be opened", path.display()))?;
    Ok(BufReader::new(file))
}

/// Predictions on left-out scenes, with a bar.
pub fn held_out(table: &Table, params: &TrainParams, people: People) -> anyhow::Result<Vec<Prediction>> {
    let bar = LeftOut::new(table);
    let predictions = leave_one_scene_out(table, params, people, |group| bar.show(group))?;
    bar.0.finish_and_clear();
    Ok(predictions)
}

/// Predictions on left-out scenes with everything chosen without them, and what was chosen, with a bar.
pub fn chosen_and_held_out(
    table: &Table,
    params: &TrainParams,
    people: People,
) -> anyhow::Result<(Vec<Prediction>, Vec<Chosen>)> {
    let bar = LeftOut::new(table);
    let result = choose_and_leave_out(&choices(table)?, params, people, |group| bar.show(group))?;
    bar.0.finish_and_clear();
    Ok(result)
}

/// A bar over the groups of scenes.
struct LeftOut(ProgressBar);

impl LeftOut {
    fn new(table: &Table) -> Self {
        Self(bar(table.groups().len() as u64, "scenes left out"))
    }

    /// A group begins, and the one before it has ended.
    fn show(&self, group: &str) {
        if !self.0.message().is_empty() {
            self.0.inc(1);
        }
        self.0.set_message(group.to_owned());
    }
}
