//! What is answered when a request is refused: JSON that says what, where, and what to do.

use crate::error::StoreError;
use crate::session::EventMisfit;
use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use serde::Serialize;

/// A refused request.
#[derive(Debug)]
pub(crate) struct Refusal {
    status: StatusCode,
    body: Body,
}

#[derive(Debug, Serialize)]
struct Body {
    what: String,
    r#where: String,
    what_to_do: String,
    /// Number that the next event of the session has to have, where that is what was wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    next_seq: Option<u64>,
}

impl Refusal {
    pub(crate) fn new(
        status: StatusCode,
        what: impl Into<String>,
        place: impl Into<String>,
        what_to_do: impl Into<String>,
    ) -> Self {
        let (what, place, what_to_do) = (what.into(), place.into(), what_to_do.into());
        Self { status, body: Body { what, r#where: place, what_to_do, next_seq: None } }
    }

    /// The number of an event is taken by another one, or leaves a gap.
    pub(crate) fn conflict(seq: u64, next: u64) -> Self {
        let what = if seq < next {
            format!("event {seq} is there already, and is another one")
        } else {
            format!("event {seq} leaves a gap: the next one is {next}")
        };
        let mut refusal = Self::new(
            StatusCode::CONFLICT,
            what,
            "seq",
            "load the session again, and continue from its next_seq",
        );
        refusal.body.next_seq = Some(next);
        refusal
    }

    /// An event that cannot have happened.
    pub(crate) fn misfit(misfit: &EventMisfit, next: u64) -> Self {
        let status = StatusCode::UNPROCESSABLE_ENTITY;
        let mut refusal =
            Self::new(status, misfit.to_string(), "event", "load the session again, and show what it says");
        refusal.body.next_seq = Some(next);
        refusal
    }

    pub(crate) fn is_unknown_code(&self) -> bool {
        self.status == StatusCode::NOT_FOUND && self.body.r#where == "code"
    }

    pub(crate) fn unknown_code() -> Self {
        let do_ = "check the code, or begin a new session";
        Self::new(StatusCode::NOT_FOUND, "no session has this code", "code", do_)
    }
}

impl From<StoreError> for Refusal {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Unknown(_) => Self::unknown_code(),
            StoreError::NoLink => {
                let do_ = "copy the whole link, or ask who invited you";
                Self::new(StatusCode::NOT_FOUND, "nobody was invited by this link", "link", do_)
            }
            StoreError::Conflict { seq, .. } => Self::conflict(seq, seq + 1),
            error => {
                // Paths of the machine are for who runs the server, not for who answers
                eprintln!("error: {error}");
                let what = "the answer could not be kept";
                let do_ = "tell who runs the study; answers that were acknowledged are safe";
                Self::new(StatusCode::INTERNAL_SERVER_ERROR, what, "database", do_)
            }
        }
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        (self.status, Json(self.body)).into_response()
    }
}
