//! A session rebuilt from its events.

use super::state::ParticipantSession;
use crate::config::Study;
use crate::error::StoreError;
use crate::questplus::QuestGrid;
use crate::store::SessionRecord;
use std::sync::Arc;

/// Replays a session from the database.
///
/// # Errors
/// [`StoreError::Event`] if an event does not fit.
pub fn replay(
    study: Arc<Study>,
    grids: Arc<Vec<Arc<QuestGrid>>>,
    record: &SessionRecord,
) -> Result<ParticipantSession, StoreError> {
    let mut session = ParticipantSession::new(study, grids, record.seed).simulated(record.simulated);
    for (seq, envelope) in record.events.iter().enumerate() {
        let misfit = |what: String| StoreError::Event { code: record.code.clone(), seq: seq as u64, what };
        if envelope.seq != seq as u64 {
            return Err(misfit("its number leaves a gap".to_owned()));
        }
        session.apply(&envelope.event).map_err(|e| misfit(e.to_string()))?;
    }
    Ok(session)
}
