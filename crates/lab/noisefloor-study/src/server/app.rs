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

    /// The session of a slot, rebuilt from its events if it is not in memory.
    async fn session<'a>(
        &self,
        code: &str,
        live: &'a mut Option<ParticipantSession>,
    ) -> Result<&'a mut ParticipantSession, Refusal> {
        if live.is_none() {
            *live = Some(self.load(code).await.inspect_err(|_| self.forget(code))?);
        }
        live.as_mut().ok_or_else(|| StoreError::Closed.into())
    }

    async fn load(&self, code: &str) -> Result<ParticipantSession, StoreError> {
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
        Ok(with(self.session(code, &mut live).await?))
    }

    /// Checks an event, stores it, and only then lets it count. A stored event is acknowledged again.
    pub(super) async fn record(&self, code: &str, envelope: Envelope) -> Result<ParticipantSession, Refusal> {
        let place = self.place(code);
        let mut live = place.lock().await;
        let now = self.session(code, &mut live).await?;
        let (seq, next) = (envelope.seq, now.events());
        if seq < next {
            let there = self.store.event(code, seq).await?;
            return if there == Some(envelope) { Ok(now.clone()) } else { Err(conflict(seq, next)) };
        }
        if seq > next {
            return Err(conflict(seq, next));
        }
        let mut after = now.clone();
        after.apply(&envelope.event).map_err(|misfit| {
            let do_ = "load the session again, and show what it says";
            let refusal = Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, misfit.to_string(), "event", do_);
            refusal.with_next_seq(next)
        })?;
        // Whether it is on disk is unknown after a failure: the session is then read again next time
        if let Err(error) = self.store.append(code, envelope).await {
            *live = None;
            self.forget(code);
            return Err(error.into());
        }
        *now = after.clone();
        Ok(after)
    }
}
