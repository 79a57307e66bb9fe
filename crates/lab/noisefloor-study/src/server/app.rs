//! State shared by all requests: the study, its answers, and the sessions in memory.

use super::tiles::TileCache;
use crate::config::Study;
use crate::error::{StoreError, conflict};
use crate::event::Envelope;
use crate::session::{ParticipantSession, replay};
use crate::store::AnswerStore;
use axum::http::StatusCode;
use noisefloor_pages::http::{Guard, Refusal};
use noisefloor_pages::questplus::QuestGrid;
use std::collections::HashMap;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

/// Most sessions kept in memory; others are read from the database when they continue.
const MOST_LIVE: usize = 1000;

/// A session in memory; `None` until it has been read from the database.
type Live = Arc<tokio::sync::Mutex<Option<ParticipantSession>>>;

pub(crate) struct App {
    pub(super) study: Arc<Study>,
    pub(super) grids: Arc<Vec<Arc<QuestGrid>>>,
    pub(super) store: AnswerStore,
    pub(super) live: Mutex<HashMap<String, Live>>,
    pub(super) tiles: TileCache,
    pub(super) guard: Arc<Guard>,
    pub(super) simulated: AtomicBool,
    /// Opens the experimenter's page.
    pub(super) key: String,
}

impl App {
    /// The slot of a session in memory, empty at first. Unknown codes are not remembered.
    pub(super) fn place(&self, code: &str) -> Live {
        let mut live = self.live.lock().unwrap_or_else(PoisonError::into_inner);
        if live.len() >= MOST_LIVE {
            // Only the map refers to sessions with one reference
            live.retain(|_, session| Arc::strong_count(session) > 1);
        }
        live.entry(code.to_owned()).or_default().clone()
    }

    pub(super) fn forget(&self, code: &str) {
        self.live.lock().unwrap_or_else(PoisonError::into_inner).remove(code);
    }

    /// Rebuilds a session from its events.
    pub(super) async fn load(&self, code: &str) -> Result<ParticipantSession, StoreError> {
        let record = self.store.load(code).await?;
        // Replaying a forced choice takes a tenth of a second
        let (study, grids) = (self.study.clone(), self.grids.clone());
        let replayed = tokio::task::spawn_blocking(move || replay(study, grids, &record)).await;
        replayed.map_err(|_| StoreError::Closed)?
    }

    /// Runs `with` on a session while nobody else can change it.
    pub(super) async fn with<T>(
        &self,
        code: &str,
        with: impl FnOnce(&ParticipantSession) -> T,
    ) -> Result<T, Refusal> {
        let place = self.place(code);
        let mut live = place.lock().await;
        if live.is_none() {
            match self.load(code).await {
                Ok(session) => *live = Some(session),
                Err(error) => {
                    self.forget(code);
                    return Err(error.into());
                }
            }
        }
        live.as_ref().map(with).ok_or_else(|| StoreError::Closed.into())
    }

    /// Checks an event, stores it, and only then lets it count. A stored event is acknowledged again.
    pub(super) async fn record(&self, code: &str, envelope: Envelope) -> Result<ParticipantSession, Refusal> {
        let place = self.place(code);
        let mut live = place.lock().await;
        let now = match live.take() {
            Some(session) => session,
            None => match self.load(code).await {
                Ok(session) => session,
                Err(error) => {
                    self.forget(code);
                    return Err(error.into());
                }
            },
        };
        let seq = envelope.seq;
        if seq < now.events() {
            let there = self.store.event(code, seq).await;
            let same = matches!(&there, Ok(Some(there)) if *there == envelope);
            let next = now.events();
            let session = live.insert(now);
            return match there {
                Err(error) => Err(error.into()),
                Ok(_) if same => Ok(session.clone()),
                Ok(_) => Err(conflict(seq, next)),
            };
        }
        if seq > now.events() {
            let next = now.events();
            *live = Some(now);
            return Err(conflict(seq, next));
        }
        let mut after = now.clone();
        if let Err(misfit) = after.apply(&envelope.event) {
            let next = now.events();
            *live = Some(now);
            let do_ = "load the session again, and show what it says";
            let refusal = Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, misfit.to_string(), "event", do_);
            return Err(refusal.with_next_seq(next));
        }
        if let Err(error) = self.store.append(code, envelope).await {
            // Whether it is on disk is unknown: the session is read again next time
            self.forget(code);
            return Err(error.into());
        }
        Ok(live.insert(after).clone())
    }
}
