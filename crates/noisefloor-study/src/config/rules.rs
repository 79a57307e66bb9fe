//! What a study file may ask for beside its pictures: texts, questions, and rules that are fixed before
//! anyone answers.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The task of the observers.
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
    /// Name of the study.
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
    /// Largest share of hasty trials.
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
    /// Kind of answer.
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

/// Kind of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum QuestionKind {
    /// A number.
    Number,
    /// One of the options.
    Choice,
    /// Up to 500 characters.
    Text,
}

/// One answer of a choice.
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
