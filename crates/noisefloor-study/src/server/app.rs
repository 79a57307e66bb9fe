//! What all requests share: the study, its answers, and the sessions in memory.

use super::tiles::TileCache;
use crate::config::Study;
use crate::error::StoreError;
use crate::event::Envelope;
use crate::http::Guard;
use crate::http::Refusal;
use crate::questplus::QuestGrid;
use crate::session::{ParticipantSession, replay};
use crate::store::AnswerStore;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Sessions that are kept in memory; others are read again from the database when they go on.
const MOST_LIVE: usize = 1000;

/// A session in memory; `None` until it has been read from the database.
type Live = Arc<tokio::sync::Mutex<Option<ParticipantSession>>>;

/// Everything that requests share.
pub(crate) struct App {
    pub(super) study: Arc<Study>,
    pub(super) grids: Arc<Vec<Arc<QuestGrid>>>,
    pub(super) store: AnswerStore,
    pub(super) live: Mutex<HashMap<String, Live>>,
    pub(super) tiles: TileCache,
    pub(super) guard: Arc<Guard>,
}

impl App {
    /// The place of a session in memory, which is empty at first. A code that is in no database is not
    /// remembered.
    pub(super) fn place(&self, code: &str) -> Live {
        let mut live = self.live.lock().unwrap_or_else(PoisonError::into_inner);
        if live.len() >= MOST_LIVE {
            // Nobody holds those that only the map knows
            live.retain(|_, session| Arc::strong_count(session) > 1);
        }
        live.entry(code.to_owned()).or_default().clone()
    }

    pub(super) fn forget(&self, code: &str) {
        self.live.lock().unwrap_or_else(PoisonError::into_inner).remove(code);
    }

    /// A session as its events left it.
    pub(super) async fn load(&self, code: &str) -> Result<ParticipantSession, StoreError> {
        let record = self.store.load(code).await?;
        // Replaying forced choices takes a tenth of a second
        let (study, grids) = (self.study.clone(), self.grids.clone());
        let replayed = tokio::task::spawn_blocking(move || replay(study, grids, &record)).await;
        replayed.map_err(|_| StoreError::Closed)?
    }

    /// Runs `with` on a session, which nobody else changes meanwhile.
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

    /// Takes an event: checks it, keeps it, and only then lets it count. An event that is there already is
    /// acknowledged again.
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
                Ok(_) => Err(Refusal::conflict(seq, next)),
            };
        }
        if seq > now.events() {
            let next = now.events();
            *live = Some(now);
            return Err(Refusal::conflict(seq, next));
        }
        let mut after = now.clone();
        if let Err(misfit) = after.apply(&envelope.event) {
            let next = now.events();
            *live = Some(now);
            return Err(Refusal::misfit(&misfit, next));
        }
        if let Err(error) = self.store.append(code, envelope).await {
            // What is on disk is not known: it is read again next time
            self.forget(code);
            return Err(error.into());
        }
        Ok(live.insert(after).clone())
    }
}
