//! A study file: as it is written, the rules that it fixes before anyone answers, and the checked study.

use crate::error::StudyError;
use crate::stack::{StackEntry, StudyStack};
use noisefloor::tile::DEFAULT_TILE;
use noisefloor_pages::languages::{Language, read_languages};
use noisefloor_pages::viewing::ViewingLimits;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Longest study file, in bytes.
const MAX_FILE: u64 = 1 << 20;
pub(crate) const MAX_STACKS: usize = 200;
/// Most groups of observers, questions, and answers of a choice.
const MAX_ENTRIES: usize = 40;
/// Most showings of a pair to one observer.
const MAX_REPEATS: u32 = 10;
/// Most forced-choice trials of one tile.
const MAX_TRIALS: u32 = 200;

/// A checked study: everything that a session depends on.
#[derive(Debug)]
#[non_exhaustive]
pub struct Study {
    pub protocol: StudyProtocol,
    pub database: PathBuf,
    /// Showings of each pair to each observer (acquisition, validation).
    pub repeats: u32,
    /// Trials of each tile (forced choice).
    pub trials: u32,
    /// Display time of an interval, in milliseconds (forced choice).
    pub interval_ms: u32,
    /// Expected duration in minutes, told to observers.
    pub minutes: Option<u32>,
    /// Trials between two suggested breaks.
    pub break_every: Option<u32>,
    /// Mixed into the order of every session.
    pub seed: u64,
    /// Groups that observers choose from; may be empty.
    pub groups: Vec<String>,
    pub participants: Participants,
    pub screening: Screening,
    pub viewing: ViewingLimits,
    /// Questions before the trials.
    pub questions: Vec<Question>,
    /// By language, at least one.
    pub text: BTreeMap<String, Texts>,
    /// Texts of the pages in these languages.
    pub languages: BTreeMap<String, Language>,
    /// The pictures, at least one stack.
    pub stacks: Vec<StudyStack>,
}

/// The part of a study that answers depend on. A database belongs to one design. The rules of exclusion are
/// part of it: nobody changes them after looking at the answers.
#[derive(Serialize)]
struct Design<'a> {
    protocol: StudyProtocol,
    repeats: u32,
    trials: u32,
    seed: u64,
    screening: &'a Screening,
    viewing: &'a ViewingLimits,
    questions: Vec<(&'a str, QuestionKind)>,
    stacks: Vec<StackDesign<'a>>,
}

#[derive(Serialize)]
struct StackDesign<'a> {
    name: &'a str,
    size: [usize; 2],
    tile: usize,
    levels: &'a [u64],
    stops: Option<&'a [u32]>,
    /// Frames, and their rate.
    #[serde(skip_serializing_if = "Option::is_none")]
    film: Option<(u32, f64)>,
}

impl Study {
    /// Reads a study file. Relative paths start at its folder. Opens the most converged picture of each
    /// stack;
    /// [`Study::check_pictures`] opens the others.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, StudyError> {
        let path = path.as_ref();
        let mut text = String::new();
        let length = File::open(path).and_then(|f| f.take(MAX_FILE + 1).read_to_string(&mut text));
        let length = length.map_err(|fault| StudyError::at(path, fault))?;
        let bad = |what: String| StudyError::at(path, what);
        if length as u64 > MAX_FILE {
            return Err(bad(format!("longer than {MAX_FILE} bytes")));
        }
        let file: StudyFile = toml::from_str(&text).map_err(|e| bad(e.to_string().trim_end().to_owned()))?;
        check_rules(&file).map_err(bad)?;
        let beside = path.parent().unwrap_or(Path::new(""));
        let languages = read_languages(file.languages.as_ref().map(|l| beside.join(l)).as_deref())?;
        let spoken = check_texts(&file, &languages).map_err(bad)?;
        check_stacks(&file).map_err(bad)?;
        Self::build(file, spoken, beside)
    }

    fn build(
        file: StudyFile,
        languages: BTreeMap<String, Language>,
        beside: &Path,
    ) -> Result<Self, StudyError> {
        let tile = file.tile.unwrap_or(DEFAULT_TILE);
        let stack = |entry| StudyStack::open(entry, beside, tile);
        let twice = file.protocol == StudyProtocol::Acquisition;
        Ok(Self {
            protocol: file.protocol,
            database: beside.join(file.database),
            repeats: file.repeats.unwrap_or(if twice { 2 } else { 1 }),
            trials: file.trials.unwrap_or(32),
            interval_ms: file.interval_ms.unwrap_or(1000),
            minutes: file.minutes,
            break_every: file.break_every,
            seed: file.seed.unwrap_or(1),
            groups: file.groups,
            participants: file.participants,
            screening: file.screening,
            viewing: file.viewing,
            questions: file.question,
            text: file.text,
            languages,
            stacks: file.stack.into_iter().map(stack).collect::<Result<_, _>>()?,
        })
    }

    /// Opens every picture, so that none fails while an observer is looking.
    pub fn check_pictures(&self) -> Result<(), StudyError> {
        self.stacks.iter().try_for_each(StudyStack::check_pictures)
    }

    /// The design as text. Answers belong to studies of equal designs only.
    pub fn design(&self) -> String {
        let stack = |s| {
            let s: &StudyStack = s;
            StackDesign {
                name: s.name(),
                size: [s.grid().width(), s.grid().height()],
                tile: s.grid().edge(),
                levels: s.levels(),
                stops: s.stops(),
                film: s.fps().map(|fps| (s.frames(), fps)),
            }
        };
        let Self { protocol, repeats, trials, seed, .. } = *self;
        let design = Design {
            protocol,
            repeats,
            trials,
            seed,
            screening: &self.screening,
            viewing: &self.viewing,
            questions: self.questions.iter().map(|q| (q.id.as_str(), q.kind)).collect(),
            stacks: self.stacks.iter().map(stack).collect(),
        };
        serde_json::to_string(&design).unwrap_or_default()
    }
}

fn is_plain(name: &str) -> bool {
    !name.is_empty() && name.len() <= 64 && !name.chars().any(char::is_control)
}

fn check_rules(file: &StudyFile) -> Result<(), String> {
    let within = |name: &str, value: Option<u32>, most: u32| match value {
        Some(value) if !(1..=most).contains(&value) => Err(format!("{name} is {value}, not 1 to {most}")),
        _ => Ok(()),
    };
    within("repeats", file.repeats, MAX_REPEATS)?;
    within("trials", file.trials, MAX_TRIALS)?;
    within("interval-ms", file.interval_ms, 10_000)?;
    within("minutes", file.minutes, 600)?;
    within("break-every", file.break_every, 10_000)?;
    if file.groups.len() > MAX_ENTRIES || !file.groups.iter().all(|g| is_plain(g)) {
        return Err(format!("groups are at most {MAX_ENTRIES} names of 1 to 64 characters"));
    }
    let Screening { catch, catch_errors, hasty_share, untouched_share, outlying, minimum_ms, .. } =
        file.screening;
    for (name, share) in
        [("catch-errors", catch_errors), ("hasty-share", hasty_share), ("untouched-share", untouched_share)]
    {
        if !(0.0..=1.0).contains(&share) {
            return Err(format!("[screening] {name} is {share}, not 0 to 1"));
        }
    }
    if catch.is_some_and(|n| n > 100) || outlying.is_nan() || outlying <= 0.0 || minimum_ms > 10_000 {
        return Err("[screening] catch is at most 100, outlying above 0, minimum-ms at most 10000".into());
    }
    let limits = &file.viewing;
    for (name, [low, high]) in [
        ("pixels-per-degree", limits.pixels_per_degree),
        ("distance-mm", limits.distance_mm),
        ("gamma", limits.gamma),
    ] {
        if (low..=high).is_empty() {
            return Err(format!("[viewing] {name} goes from {low} to {high}: the range is empty"));
        }
    }
    if limits.ambient.is_empty() {
        return Err("[viewing] ambient is empty, so that nobody could take part".into());
    }
    let Participants { completion_url, screened_out_url, id_parameters, .. } = &file.participants;
    for url in [completion_url, screened_out_url].into_iter().flatten() {
        if !url.starts_with("https://") && !url.starts_with("http://") {
            return Err(format!("[participants] {url:?} is not a web address"));
        }
    }
    let parameter =
        |p: &String| is_plain(p) && p.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c));
    if id_parameters.len() > MAX_ENTRIES || !id_parameters.iter().all(parameter) {
        return Err("[participants] id-parameters are names of letters, digits, - and _".into());
    }
    Ok(())
}

/// Texts and questions exist in the same languages, and the pages know them. Returns these languages.
fn check_texts(
    file: &StudyFile,
    known: &BTreeMap<String, Language>,
) -> Result<BTreeMap<String, Language>, String> {
    if file.text.is_empty() {
        return Err("no [text.en]: observers must be told what they consent to".into());
    }
    let mut spoken = BTreeMap::new();
    for code in file.text.keys() {
        let Some(language) = known.get(code) else {
            let known: Vec<&str> = known.keys().map(String::as_str).collect();
            return Err(format!(
                "[text.{code}]: the pages know {}; add {code}.toml to the folder named by `languages`",
                known.join(", ")
            ));
        };
        spoken.insert(code.clone(), language.clone());
    }
    if file.question.len() > MAX_ENTRIES {
        return Err(format!("{} questions; at most {MAX_ENTRIES} are asked", file.question.len()));
    }
    let mut ids = BTreeSet::new();
    for question in &file.question {
        let id = &question.id;
        if !is_plain(id) || !ids.insert(id) {
            return Err(format!("question {id:?}: the id is empty, too long, or taken"));
        }
        let choice = question.kind == QuestionKind::Choice;
        if choice != (2..=MAX_ENTRIES).contains(&question.option.len()) {
            return Err(format!(
                "question {id:?}: a choice has 2 to {MAX_ENTRIES} options, others have none"
            ));
        }
        let texts = question.option.iter().map(|o| &o.text).chain([&question.text]);
        for text in texts {
            if let Some(code) = file.text.keys().find(|code| !text.contains_key(*code)) {
                return Err(format!("question {id:?} has no text in {code}"));
            }
        }
    }
    Ok(spoken)
}

/// Names become folders of the corpus: each is plain, and used once.
fn check_stacks(file: &StudyFile) -> Result<(), String> {
    if !(1..=MAX_STACKS).contains(&file.stack.len()) {
        return Err(format!("{} [[stack]] entries; a study has 1 to {MAX_STACKS}", file.stack.len()));
    }
    let mut names = BTreeSet::new();
    for StackEntry { name, stops, fps, .. } in &file.stack {
        let folder = |c: char| c.is_alphanumeric() || "-_. ".contains(c);
        if !is_plain(name) || !name.chars().all(folder) || name.starts_with('.') {
            return Err(format!("stack name {name:?} is not a plain name: letters, digits, - and _"));
        }
        if !names.insert(name) {
            return Err(format!("two stacks are called {name:?}"));
        }
        if fps.is_some_and(|fps| !(1.0..=240.0).contains(&fps)) {
            return Err(format!("stack {name:?}: fps is the rate of a film, 1 to 240 frames a second"));
        }
        if file.protocol == StudyProtocol::Validation && stops.is_none() {
            return Err(format!(
                "stack {name:?} has no `stops`: a validation shows pictures assembled from where tiles stopped"
            ));
        }
    }
    Ok(())
}

// What a study file may ask for beside its pictures: texts, questions, and rules that are fixed before

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StudyProtocol {
    /// Point at differences from the reference until there are none (Takouachet et al. 2017, §4.2.2).
    Acquisition,
    /// Say whether the pictures of a pair are identical (§7.2).
    Validation,
    /// Say which of two intervals was noisy; QUEST+ chooses the levels (Watson 2017).
    ForcedChoice,
}

/// What observers read, in one language.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Texts {
    pub title: String,
    /// The task; empty lines separate paragraphs. The pages add how to answer.
    #[serde(default)]
    pub instructions: String,
    /// What observers consent to.
    pub consent: String,
    /// Shown after the last trial: what the study was about, and whom to ask.
    #[serde(default)]
    pub debriefing: String,
}

/// How participants arrive, and what they are given at the end.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct Participants {
    /// Whether a session can only begin from a one-time link.
    pub links_only: bool,
    /// Query parameters kept as opaque identifiers, for example `PROLIFIC_PID`.
    pub id_parameters: Vec<String>,
    /// Code shown after the last trial, and not before.
    pub completion_code: Option<String>,
    /// Address offered after the last trial.
    pub completion_url: Option<String>,
    /// Address offered to those who did not pass the practice.
    pub screened_out_url: Option<String>,
}

/// Rules of exclusion and of valid trials, fixed by the study file before anyone answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct Screening {
    /// Catch trials of each kind that the protocol has. `None` stands for the default of the protocol.
    pub catch: Option<u32>,
    /// Largest share of catch trials that may fail.
    pub catch_errors: f64,
    /// Rounds of practice offered; 0 accepts any practice.
    pub practice_attempts: u32,
    /// Time after onset before which no answer is taken, in milliseconds.
    pub minimum_ms: u32,
    /// Trials answered sooner than this count as hasty, in milliseconds.
    pub hasty_ms: u32,
    pub hasty_share: f64,
    /// Acquisition: largest share of tiles left at the noisiest level.
    pub untouched_share: f64,
    /// Largest modified z-score of an observer's sensitivity and consistency, where there are at least 20.
    pub outlying: f64,
    /// Whether to screen observers by Recommendation ITU-R BT.500, annex 1, §2.3.1.
    pub bt500: bool,
}

impl Default for Screening {
    fn default() -> Self {
        Self {
            catch: None,
            catch_errors: 0.25,
            practice_attempts: 3,
            minimum_ms: 300,
            hasty_ms: 500,
            hasty_share: 0.25,
            untouched_share: 0.5,
            outlying: 5.0,
            bt500: true,
        }
    }
}

impl Screening {
    /// Catch trials of each kind. The defaults let an attentive observer pass, and stop most random answers:
    /// 10 trials of which 2 may fail pass 5 % of coin flippers.
    pub fn catch_trials(&self, protocol: StudyProtocol) -> u32 {
        self.catch.unwrap_or(match protocol {
            StudyProtocol::Acquisition => 2,
            StudyProtocol::Validation => 3,
            StudyProtocol::ForcedChoice => 10,
        })
    }
}

/// A question asked before the trials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Question {
    /// Name of the column in the data.
    pub id: String,
    pub kind: QuestionKind,
    /// Whether it may be left empty.
    #[serde(default)]
    pub optional: bool,
    /// Number: smallest and largest answer.
    pub range: Option<[f64; 2]>,
    /// The question, by language.
    pub text: BTreeMap<String, String>,
    /// Choice: the answers offered.
    #[serde(default)]
    pub option: Vec<AnswerOption>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum QuestionKind {
    Number,
    /// One of the options.
    Choice,
    /// Up to 500 characters.
    Text,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnswerOption {
    /// Value in the data.
    pub id: String,
    /// The answer, by language.
    pub text: BTreeMap<String, String>,
}

impl Question {
    /// Whether an answer is valid; an empty one is, if the question is optional.
    pub fn accepts(&self, answer: &str) -> bool {
        if answer.is_empty() {
            return self.optional;
        }
        match self.kind {
            QuestionKind::Text => answer.chars().count() <= 500,
            QuestionKind::Choice => self.option.iter().any(|o| o.id == answer),
            QuestionKind::Number => {
                let [low, high] = self.range.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
                answer.parse::<f64>().is_ok_and(|n| n.is_finite() && (low..=high).contains(&n))
            }
        }
    }
}

// The study file as it is written, before anything is checked.

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct StudyFile {
    protocol: StudyProtocol,
    database: PathBuf,
    languages: Option<PathBuf>,
    tile: Option<usize>,
    repeats: Option<u32>,
    seed: Option<u64>,
    trials: Option<u32>,
    interval_ms: Option<u32>,
    minutes: Option<u32>,
    break_every: Option<u32>,
    #[serde(default)]
    groups: Vec<String>,
    #[serde(default)]
    participants: Participants,
    #[serde(default)]
    screening: Screening,
    #[serde(default)]
    viewing: ViewingLimits,
    #[serde(default)]
    question: Vec<Question>,
    text: BTreeMap<String, Texts>,
    stack: Vec<StackEntry>,
}
