//! The study file: what was written, and what it means once checked.

use crate::error::StudyError;
use crate::stack::{Source, StudyStack};
use noisefloor::DEFAULT_TILE;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Longest study file that is read, in bytes.
const MAX_FILE: u64 = 1 << 20;
/// Most stacks a study shows.
pub const MAX_STACKS: usize = 200;
/// Most groups of observers.
const MAX_GROUPS: usize = 20;
/// Most times that a pair is shown to one observer.
const MAX_REPEATS: u32 = 10;
/// Most forced-choice trials of one tile.
const MAX_TRIALS: u32 = 200;
/// Languages that pages are written in.
pub const LANGUAGES: [&str; 2] = ["en", "fr"];

/// What observers are asked to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StudyProtocol {
    /// Point at differences from the reference until there are none (Takouachet et al. 2017, §4.2.2).
    Acquisition,
    /// Say of pairs whether they are identical (§7.2).
    Validation,
    /// Say which of two intervals had the noise; QUEST+ chooses the levels (Watson 2017).
    ForcedChoice,
}

/// What observers read, in one language.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Texts {
    /// Name of the study.
    pub title: String,
    /// What to do; paragraphs are separated by empty lines. The pages add how the protocol is answered.
    #[serde(default)]
    pub instructions: String,
    /// What observers agree to.
    pub consent: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct StudyFile {
    protocol: StudyProtocol,
    database: PathBuf,
    tile: Option<usize>,
    repeats: Option<u32>,
    seed: Option<u64>,
    trials: Option<u32>,
    interval_ms: Option<u32>,
    #[serde(default)]
    groups: Vec<String>,
    text: BTreeMap<String, Texts>,
    stack: Vec<FileStack>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct FileStack {
    name: String,
    folder: PathBuf,
    #[serde(default)]
    renderer: String,
    /// Where each tile stopped: `stops.csv` of `noisefloor render`, or any table with the columns `tile`
    /// and `spp`.
    stops: Option<PathBuf>,
}

/// A checked study: everything that a session depends on.
#[derive(Debug)]
pub struct Study {
    /// What observers do.
    pub protocol: StudyProtocol,
    /// File of the answers.
    pub database: PathBuf,
    /// Times that each pair is shown to each observer (acquisition, validation).
    pub repeats: u32,
    /// Trials of each tile (forced choice).
    pub trials: u32,
    /// Time that an interval is shown, in milliseconds (forced choice).
    pub interval_ms: u32,
    /// Mixed into the order of every session.
    pub seed: u64,
    /// Groups that observers choose from; may be empty.
    pub groups: Vec<String>,
    /// By language; those of [`LANGUAGES`] alone, at least one.
    pub text: BTreeMap<String, Texts>,
    /// The pictures, at least one stack.
    pub stacks: Vec<StudyStack>,
}

/// The part of a study that answers depend on: a database keeps it, and goes with no other.
#[derive(Serialize)]
struct Design {
    protocol: StudyProtocol,
    repeats: u32,
    trials: u32,
    seed: u64,
    stacks: Vec<DesignStack>,
}

#[derive(Serialize)]
struct DesignStack {
    name: String,
    size: [usize; 2],
    tile: usize,
    levels: Vec<u64>,
    stops: Option<Vec<u32>>,
}

impl Study {
    /// Reads a study file, and lists its stacks; relative paths are those beside the file. Opens the most
    /// converged picture of each stack; [`Study::check_pictures`] opens the others.
    ///
    /// # Errors
    /// [`StudyError`] if the file is malformed or a stack is not sound.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, StudyError> {
        let path = path.as_ref();
        let io = |source| StudyError::Io { path: path.to_owned(), source };
        let mut text = String::new();
        let length =
            File::open(path).and_then(|f| f.take(MAX_FILE + 1).read_to_string(&mut text)).map_err(io)?;
        let bad = |what: String| StudyError::File { path: path.to_owned(), what };
        if length as u64 > MAX_FILE {
            return Err(bad(format!("longer than {MAX_FILE} bytes")));
        }
        let file: StudyFile = toml::from_str(&text).map_err(|e| bad(e.to_string().trim_end().to_owned()))?;
        Self::check(file, path.parent().unwrap_or(Path::new("")), &bad)
    }

    fn check(file: StudyFile, beside: &Path, bad: &dyn Fn(String) -> StudyError) -> Result<Self, StudyError> {
        // Numbers
        let within = |name: &str, value: u32, most: u32| match value {
            1.. if value <= most => Ok(value),
            _ => Err(bad(format!("{name} is {value}, not 1 to {most}"))),
        };
        let repeats = within(
            "repeats",
            file.repeats.unwrap_or(if file.protocol == StudyProtocol::Acquisition { 2 } else { 1 }),
            MAX_REPEATS,
        )?;
        let trials = within("trials", file.trials.unwrap_or(32), MAX_TRIALS)?;
        let interval_ms = within("interval-ms", file.interval_ms.unwrap_or(1000), 10_000)?;

        // Languages and groups
        if let Some(language) = file.text.keys().find(|l| !LANGUAGES.contains(&l.as_str())) {
            return Err(bad(format!(
                "[text.{language}]: pages are written in {} alone",
                LANGUAGES.join(", ")
            )));
        }
        if file.text.is_empty() {
            return Err(
                bad("no [text.en] or [text.fr]: observers have to be told what they agree to".into()),
            );
        }
        let plain = |name: &str| !name.is_empty() && name.len() <= 64 && !name.chars().any(char::is_control);
        if file.groups.len() > MAX_GROUPS || !file.groups.iter().all(|g| plain(g)) {
            return Err(bad(format!("groups are at most {MAX_GROUPS} names of 1 to 64 characters")));
        }

        // Stacks, each name once: names become folders of the corpus
        if file.stack.is_empty() || file.stack.len() > MAX_STACKS {
            return Err(bad(format!(
                "{} [[stack]] entries; a study has 1 to {MAX_STACKS}",
                file.stack.len()
            )));
        }
        let mut names = BTreeSet::new();
        let mut stacks = Vec::with_capacity(file.stack.len());
        for entry in file.stack {
            let folder = |c: char| c.is_alphanumeric() || "-_. ".contains(c);
            let name = &entry.name;
            if !plain(name) || !name.chars().all(folder) || name.starts_with('.') {
                return Err(bad(format!(
                    "stack name {name:?} is not a plain name: letters, digits, - and _"
                )));
            }
            if !names.insert(name.clone()) {
                return Err(bad(format!("two stacks are called {name:?}")));
            }
            if file.protocol == StudyProtocol::Validation && entry.stops.is_none() {
                return Err(bad(format!(
                    "stack {name:?} has no `stops`: a validation shows pictures assembled from where tiles stopped"
                )));
            }
            stacks.push(StudyStack::open(Source {
                name: entry.name,
                renderer: entry.renderer,
                folder: beside.join(entry.folder),
                stops: entry.stops.map(|stops| beside.join(stops)),
                tile: file.tile.unwrap_or(DEFAULT_TILE),
            })?);
        }
        Ok(Self {
            protocol: file.protocol,
            database: beside.join(file.database),
            repeats,
            trials,
            interval_ms,
            seed: file.seed.unwrap_or(1),
            groups: file.groups,
            text: file.text,
            stacks,
        })
    }

    /// Opens every picture, so that none fails when an observer is looking.
    ///
    /// # Errors
    /// [`StudyError`] of the first stack that has a broken picture, or one of another size.
    pub fn check_pictures(&self) -> Result<(), StudyError> {
        self.stacks.iter().try_for_each(StudyStack::check_pictures)
    }

    /// What answers depend on, as text; equal texts mean that answers to one fit the other.
    pub fn design(&self) -> String {
        let stack = |s: &StudyStack| DesignStack {
            name: s.name().to_owned(),
            size: [s.grid().width(), s.grid().height()],
            tile: s.grid().edge(),
            levels: s.levels().to_vec(),
            stops: s.stops().map(<[u32]>::to_vec),
        };
        let Self { protocol, repeats, trials, seed, .. } = *self;
        let design =
            Design { protocol, repeats, trials, seed, stacks: self.stacks.iter().map(stack).collect() };
        serde_json::to_string(&design).unwrap_or_default()
    }
}
