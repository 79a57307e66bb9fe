//! What the pages are told, as JSON.

use crate::config::{StudyProtocol, Texts};
use crate::session::{ParticipantSession, Stage, Trial};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a page has to know of a study.
#[derive(Debug, Serialize, Deserialize)]
pub struct StudyView {
    /// What observers do.
    pub protocol: StudyProtocol,
    /// Groups that observers choose from.
    pub groups: Vec<String>,
    /// By language.
    pub text: BTreeMap<String, Texts>,
    /// Forced choice: time of an interval in milliseconds.
    pub interval_ms: u32,
    /// Shapes of the pictures.
    pub stacks: Vec<StackView>,
}

/// The shape of a stack.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StackView {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Edge of the tiles in pixels.
    pub tile: usize,
    /// Samples per pixel of each level.
    pub levels: Vec<u64>,
}

/// Where a session is.
#[derive(Debug, Serialize, Deserialize)]
pub struct SessionView {
    /// The participant's code.
    pub code: String,
    /// Number of the next event.
    pub next_seq: u64,
    /// How far the observer has come.
    pub stage: Stage,
    /// Whether the observer has paused.
    pub paused: bool,
    /// Trials answered.
    pub done: u32,
    /// Trials in all.
    pub total: u32,
    /// Language of the consent.
    pub language: Option<String>,
    /// What is to be shown.
    pub trial: Option<Trial>,
}

impl SessionView {
    pub(crate) fn of(code: &str, session: &ParticipantSession) -> Self {
        let (done, total) = session.progress();
        Self {
            code: code.to_owned(),
            next_seq: session.events(),
            stage: session.stage(),
            paused: session.is_paused(),
            done,
            total,
            language: session.language().map(str::to_owned),
            trial: session.trial(),
        }
    }
}

/// What begins a session.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beginning {
    /// One of the study's groups; empty if it has none.
    pub group: String,
    /// Whether this is a simulated observer, whose answers are kept apart.
    #[serde(default)]
    pub simulated: bool,
}
