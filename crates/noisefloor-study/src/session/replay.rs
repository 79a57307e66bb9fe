//! A session rebuilt from its events.

use super::plan::Plan;
use super::state::ParticipantSession;
use crate::config::Study;
use crate::error::StoreError;
use crate::store::SessionRecord;
use noisefloor_pages::questplus::QuestGrid;
use std::sync::Arc;

/// Replays a session from the database.
///
/// # Errors
/// [`StoreError::Plan`] if its trials are not of this study, [`StoreError::Event`] if an event does not fit.
pub fn replay(
    study: Arc<Study>,
    grids: Arc<Vec<Arc<QuestGrid>>>,
    record: &SessionRecord,
) -> Result<ParticipantSession, StoreError> {
    let mut session = begin(study, grids, record)?;
    for (seq, envelope) in record.events.iter().enumerate() {
        let misfit = |what: String| StoreError::Event { code: record.code.clone(), seq: seq as u64, what };
        if envelope.seq != seq as u64 {
            return Err(misfit("its number leaves a gap".to_owned()));
        }
        session.apply(&envelope.event).map_err(|e| misfit(e.to_string()))?;
    }
    Ok(session)
}

/// A session from the database before its first event.
pub(crate) fn begin(
    study: Arc<Study>,
    grids: Arc<Vec<Arc<QuestGrid>>>,
    record: &SessionRecord,
) -> Result<ParticipantSession, StoreError> {
    // Databases of before had the seed alone
    let plan = record.plan.clone().unwrap_or_else(|| Plan::draw(&study, record.seed));
    if !plan.fits(&study) {
        return Err(StoreError::Plan { code: record.code.clone() });
    }
    Ok(ParticipantSession::new(study, grids, plan).simulated(record.simulated))
}
