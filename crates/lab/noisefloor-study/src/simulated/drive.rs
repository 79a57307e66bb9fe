//! Drives simulated observers through a server, or through a session without one.

use super::observer::SimulatedObserver;
use crate::event::{Envelope, StudyEvent};
use crate::server::{Beginning, SessionView, StackView, StudyView};
use crate::session::{EventMisfit, ParticipantSession, Stage};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use thiserror::Error;

/// Why a simulated observer could not continue.
#[derive(Debug, Error)]
pub enum DriveError {
    #[error("{url}: no answer: {source}; is `noisefloor-lab study serve` running there?")]
    Http { url: String, source: Box<ureq::Error> },
    #[error("{url}: refused with status {status}: {body}")]
    Refused { url: String, status: u16, body: String },
    #[error(
        "simulated observers sit 600 mm from a screen of 96 dpi in a dim room; [viewing] does not allow it"
    )]
    Outside,
    #[error("{url}: not the JSON expected: {source}; is the server of the same version?")]
    Json { url: String, source: serde_json::Error },
}

/// Sends one request: GET without a body, POST with one.
fn ask<T: DeserializeOwned>(agent: &ureq::Agent, url: &str, body: Option<&str>) -> Result<T, DriveError> {
    let failed = |source| DriveError::Http { url: url.to_owned(), source: Box::new(source) };
    let mut response = match body {
        Some(body) => agent.post(url).header("content-type", "application/json").send(body),
        None => agent.get(url).call(),
    }
    .map_err(failed)?;
    let status = response.status().as_u16();
    let text = response.body_mut().read_to_string().map_err(failed)?;
    if !(200..300).contains(&status) {
        return Err(DriveError::Refused { url: url.to_owned(), status, body: text });
    }
    serde_json::from_str(&text).map_err(|source| DriveError::Json { url: url.to_owned(), source })
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// Takes a simulated observer through a whole session on a server, `http://host:port`. The group must be
/// one of the study's. `on_event` receives the time each event took to be acknowledged. Returns the code.
pub fn drive(
    server: &str,
    group: &str,
    observer: &mut SimulatedObserver,
    mut on_event: impl FnMut(Duration),
) -> Result<String, DriveError> {
    let agent = ureq::Agent::config_builder()
        .http_status_as_error(false)
        .timeout_global(Some(Duration::from_secs(60)))
        .build()
        .new_agent();
    let study: StudyView = ask(&agent, &format!("{server}/api/study"), None)?;
    let beginning = json(&Beginning { group: group.to_owned(), simulated: true, ..Beginning::default() });
    let mut view: SessionView = ask(&agent, &format!("{server}/api/sessions"), Some(&beginning))?;
    let code = view.code.clone();
    let url = format!("{server}/api/sessions/{code}/events");
    let mut send = |view: &mut SessionView, event: StudyEvent| {
        let at = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_millis() as u64);
        let begun = Instant::now();
        *view = ask(&agent, &url, Some(&json(&Envelope { seq: view.next_seq, at, event })))?;
        on_event(begun.elapsed());
        Ok(())
    };
    let language = study.text.keys().next().cloned().unwrap_or_default();
    for event in observer.arrive(&language, &study.questions) {
        send(&mut view, event)?;
    }
    if view.stage == Stage::Conditions {
        return Err(DriveError::Outside);
    }
    while let Some(trial) = view.trial.take() {
        for event in observer.respond(&trial, &study.stacks) {
            send(&mut view, event)?;
        }
    }
    Ok(code)
}

/// Takes a simulated observer through a whole session without a server.
pub fn run(session: &mut ParticipantSession, observer: &mut SimulatedObserver) -> Result<(), EventMisfit> {
    let stacks: Vec<StackView> = session.study().stacks.iter().map(StackView::of).collect();
    let language = session.study().text.keys().next().cloned().unwrap_or_default();
    let questions = session.study().questions.clone();
    for event in observer.arrive(&language, &questions) {
        session.apply(&event)?;
    }
    while session.stage() == Stage::Trials {
        let Some(trial) = session.trial() else { break };
        for event in observer.respond(&trial, &stacks) {
            session.apply(&event)?;
        }
    }
    Ok(())
}
