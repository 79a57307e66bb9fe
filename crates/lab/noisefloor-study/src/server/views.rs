//! What the pages are told, as JSON.

use crate::config::{Question, Study, StudyProtocol, Texts};
use crate::session::{ParticipantSession, Stage, Trial, TrialRole};
use crate::stack::StudyStack;
use noisefloor_pages::languages::Direction;
use noisefloor_pages::viewing::{Conditions, ViewingProblem};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a page has to know about a study.
#[derive(Debug, Serialize, Deserialize)]
pub struct StudyView {
    pub protocol: StudyProtocol,
    /// Groups that observers choose from.
    pub groups: Vec<String>,
    /// Texts by language, without the debriefing.
    pub text: BTreeMap<String, Texts>,
    /// Names and directions of these languages.
    pub languages: BTreeMap<String, LanguageView>,
    /// Forced choice: display time of an interval in milliseconds.
    pub interval_ms: u32,
    /// Time after onset before which no answer is taken, in milliseconds.
    pub minimum_ms: u32,
    /// Expected duration in minutes.
    pub minutes: Option<u32>,
    /// Whether a session can only begin from a one-time link.
    pub links_only: bool,
    /// Query parameters kept as opaque identifiers.
    pub id_parameters: Vec<String>,
    pub questions: Vec<Question>,
    pub stacks: Vec<StackView>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LanguageView {
    /// Name of the language, in the language.
    pub name: String,
    pub direction: Direction,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StackView {
    pub width: usize,
    pub height: usize,
    /// Edge of the tiles in pixels.
    pub tile: usize,
    /// Samples per pixel of each level.
    pub levels: Vec<u64>,
    /// Frames of a loop; one of a still.
    pub frames: u32,
    /// Frames per second of a loop.
    pub fps: Option<f64>,
}

impl StackView {
    pub fn of(stack: &StudyStack) -> Self {
        let grid = stack.grid();
        let levels = stack.levels().to_vec();
        let (frames, fps) = (stack.frames(), stack.fps());
        Self { width: grid.width(), height: grid.height(), tile: grid.edge(), levels, frames, fps }
    }
}

impl StudyView {
    pub(crate) fn of(study: &Study) -> Self {
        let texts = |(code, text): (&String, &Texts)| {
            (code.clone(), Texts { debriefing: String::new(), ..text.clone() })
        };
        let language = |(code, l): (&String, &noisefloor_pages::languages::Language)| {
            (code.clone(), LanguageView { name: l.name.clone(), direction: l.direction })
        };
        Self {
            protocol: study.protocol,
            groups: study.groups.clone(),
            text: study.text.iter().map(texts).collect(),
            languages: study.languages.iter().map(language).collect(),
            interval_ms: study.interval_ms,
            minimum_ms: study.screening.minimum_ms,
            minutes: study.minutes,
            links_only: study.participants.links_only,
            id_parameters: study.participants.id_parameters.clone(),
            questions: study.questions.clone(),
            stacks: study.stacks.iter().map(StackView::of).collect(),
        }
    }
}

#[derive(Debug, Serialize, Deserialize)]
pub struct SessionView {
    pub code: String,
    /// Number of the next event.
    pub next_seq: u64,
    /// How far the observer has come.
    pub stage: Stage,
    pub paused: bool,
    pub done: u32,
    pub total: u32,
    /// Number of the trial among those of practice or of data, from 1, and how many there are.
    pub ordinal: (u32, u32),
    /// Rounds of practice begun.
    pub practice_round: u32,
    /// Whether this is a good moment for a break.
    pub break_due: bool,
    /// Language of the consent.
    pub language: Option<String>,
    /// Viewing conditions, as last reported.
    pub conditions: Option<Conditions>,
    /// Which of them the study does not accept.
    pub viewing_problem: Option<ViewingProblem>,
    pub trial: Option<Trial>,
    /// After the session has ended: what the observer is given.
    pub completion: Option<CompletionView>,
}

/// What an observer takes away.
#[derive(Debug, Serialize, Deserialize)]
pub struct CompletionView {
    /// Code that proves the participation.
    pub code: Option<String>,
    /// Address to return to.
    pub url: Option<String>,
    /// What the study was about.
    pub debriefing: String,
}

impl SessionView {
    pub(crate) fn of(code: &str, session: &ParticipantSession) -> Self {
        let (done, total) = session.progress();
        let (ordinal, of) = session.ordinal();
        let practice = session.role() == Some(TrialRole::Practice);
        let due = |every: u32| !practice && ordinal > 1 && (ordinal - 1) % every == 0;
        Self {
            code: code.to_owned(),
            next_seq: session.events(),
            stage: session.stage(),
            paused: session.is_paused(),
            done,
            total,
            ordinal: (ordinal, of),
            practice_round: session.practice_rounds(),
            break_due: session.study().break_every.is_some_and(due),
            language: session.language().map(str::to_owned),
            conditions: session.conditions().copied(),
            viewing_problem: session.viewing_problem(),
            trial: session.trial(),
            completion: completion(session),
        }
    }
}

fn completion(session: &ParticipantSession) -> Option<CompletionView> {
    let study = session.study();
    // Codes are money: a program that answers for people gets none
    let paid = |of: &Option<String>| of.clone().filter(|_| !session.is_simulated());
    let text = session.language().and_then(|l| study.text.get(l));
    let debriefing = text.map(|t| t.debriefing.clone()).unwrap_or_default();
    match session.stage() {
        Stage::Finished => Some(CompletionView {
            code: paid(&study.participants.completion_code),
            url: paid(&study.participants.completion_url),
            debriefing,
        }),
        Stage::ScreenedOut => {
            Some(CompletionView { code: None, url: paid(&study.participants.screened_out_url), debriefing })
        }
        _ => None,
    }
}

#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beginning {
    /// One of the study's groups; empty if it has none.
    pub group: String,
    /// Whether this is a simulated observer, whose answers are kept apart.
    #[serde(default)]
    pub simulated: bool,
    #[serde(default)]
    pub link: Option<String>,
    /// Opaque identifiers from the address, by parameter.
    #[serde(default)]
    pub ids: BTreeMap<String, String>,
}
