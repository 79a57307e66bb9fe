//! The experimenter's page: who takes part, how far they are, and who will be excluded.

use super::app::App;
use crate::analysis::observers::Observer;
use crate::analysis::screening;
use crate::session::Stage;
use crate::store::{SessionRecord, now_ms};
use axum::Json;
use axum::extract::State;
use axum::http::header::AUTHORIZATION;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use noisefloor_pages::http::Refusal;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Without an event for this long, a session counts as a dropout, in milliseconds.
const DROPOUT_MS: u64 = 30 * 60 * 1000;
/// With an event within this time it is under way.
const ACTIVE_MS: u64 = 2 * 60 * 1000;

/// All sessions, as the experimenter sees them.
#[derive(Debug, Serialize, Deserialize)]
pub struct Overview {
    /// Clock of the server, in milliseconds since 1970.
    pub now_ms: u64,
    /// One row per session, in the order they began. Simulated observers are left out.
    pub sessions: Vec<OverviewRow>,
}

/// One session, as the experimenter sees it.
#[derive(Debug, Serialize, Deserialize)]
pub struct OverviewRow {
    pub code: String,
    pub ids: BTreeMap<String, String>,
    pub group: String,
    /// `active`, `idle`, `paused`, `dropped-out`, `screened-out` or `finished`.
    pub state: String,
    /// Trials answered, and in total.
    pub progress: (u32, u32),
    /// When it began, in milliseconds since 1970.
    pub begun_ms: u64,
    /// When the last event was stored.
    pub last_ms: u64,
    /// Trials answered per minute, from the first event to the last.
    pub trials_per_minute: Option<f64>,
    /// Rules of exclusion that the session breaks so far, in words.
    pub exclusions: Vec<String>,
}

/// `GET /api/overview`, with the key of the experimenter's page.
pub(super) async fn overview(State(app): State<Arc<App>>, headers: HeaderMap) -> Result<Response, Refusal> {
    let sent = headers.get(AUTHORIZATION).and_then(|h| h.to_str().ok()?.strip_prefix("Bearer "));
    // Equality of digests takes the same time for every wrong key
    if !sent.is_some_and(|key| blake3::hash(key.as_bytes()) == blake3::hash(app.key.as_bytes())) {
        let do_ = "open the address that `noisefloor-lab study serve` printed for the experimenter";
        return Err(Refusal::new(StatusCode::FORBIDDEN, "this page is for the experimenter", "key", do_));
    }
    let now_ms = now_ms();
    let mut sessions = Vec::new();
    for code in app.store.codes().await? {
        let record = app.store.load(&code).await?;
        if !record.simulated {
            sessions.push(row(&app, record, now_ms).await?);
        }
    }
    Ok(Json(Overview { now_ms, sessions }).into_response())
}

async fn row(app: &App, record: SessionRecord, now_ms: u64) -> Result<OverviewRow, Refusal> {
    let SessionRecord { code, ids, group, begun_ms, received_ms, .. } = record;
    let last_ms = received_ms.last().copied().unwrap_or(begun_ms);
    let minutes = passed_ms(&received_ms) as f64 / 60_000.0;
    app.with(&code, |session| {
        let progress = session.progress();
        let silent = silent_ms(now_ms, last_ms);
        let state = match session.stage() {
            Stage::Finished => "finished",
            Stage::ScreenedOut => "screened-out",
            _ if silent > DROPOUT_MS => "dropped-out",
            _ if session.is_paused() => "paused",
            _ if silent > ACTIVE_MS => "idle",
            _ => "active",
        };
        let observer = Observer::of(&code, &group, session);
        OverviewRow {
            ids,
            state: state.to_owned(),
            progress,
            begun_ms,
            last_ms,
            trials_per_minute: (minutes > 0.1).then(|| f64::from(progress.0) / minutes),
            exclusions: screening::individual(&observer, &app.study),
            code: code.clone(),
            group,
        }
    })
    .await
}

/// Time since the last event. A clock that was set back since then says only that it was another time: who is still
/// there will soon be heard by the new one.
fn silent_ms(now_ms: u64, last_ms: u64) -> u64 {
    now_ms.abs_diff(last_ms)
}

/// Time from the first event to the last, without what a clock that is set back between two events takes away.
fn passed_ms(received_ms: &[u64]) -> u64 {
    received_ms.windows(2).map(|two| two[1].saturating_sub(two[0])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINUTE: u64 = 60_000;

    #[test]
    fn a_clock_that_is_set_back_makes_nobody_active_or_fast() {
        assert_eq!(silent_ms(100 * MINUTE, 99 * MINUTE), MINUTE);
        assert!(silent_ms(40 * MINUTE, 100 * MINUTE) > DROPOUT_MS);
        // Ten minutes, an hour back, and three minutes more
        let received = [100, 105, 110, 50, 53].map(|minute| minute * MINUTE);
        assert_eq!(passed_ms(&received), 13 * MINUTE);
        assert_eq!((passed_ms(&received[..1]), passed_ms(&[])), (0, 0));
    }
}
