//! What is read from and written to the tables, inside a transaction of the caller.

use super::database::now_ms;
use super::record::{NewSession, SessionRecord};
use crate::error::StoreError;
use crate::event::Envelope;
use rusqlite::{Connection, OptionalExtension, params};

pub(super) fn all_codes(connection: &Connection) -> rusqlite::Result<Vec<String>> {
    let mut query = connection.prepare("SELECT code FROM sessions ORDER BY begun_ms, code")?;
    query.query_map([], |row| row.get(0))?.collect()
}

pub(super) fn begin(connection: &Connection, session: &NewSession) -> Result<String, StoreError> {
    let NewSession { code, seed, plan, group, simulated, ids, link } = session;
    if let Some(token) = link {
        let query = "SELECT code FROM links WHERE token = ?1";
        let found = connection.query_row(query, [token], |row| row.get::<_, Option<String>>(0)).optional();
        match found? {
            None => return Err(StoreError::NoLink),
            Some(Some(begun)) => return Ok(begun),
            Some(None) => {}
        }
    }
    let ids = serde_json::to_string(ids).unwrap_or_default();
    // SQLite integers are signed; the bit pattern is stored
    let insert = "INSERT INTO sessions VALUES (?1, ?2, ?3, ?4, ?5, ?6)";
    let row = params![code, *seed as i64, group, simulated, now_ms(), ids];
    connection.execute(insert, row)?;
    let plan = serde_json::to_string(plan).unwrap_or_default();
    connection.execute("INSERT INTO plans VALUES (?1, ?2)", [code, &plan])?;
    if let Some(token) = link {
        connection.execute("UPDATE links SET code = ?2 WHERE token = ?1", [token, code])?;
    }
    Ok(code.clone())
}

pub(super) fn append(connection: &Connection, code: &str, envelope: &Envelope) -> Result<(), StoreError> {
    let text = serde_json::to_string(envelope).unwrap_or_default();
    let insert = "INSERT OR IGNORE INTO events SELECT code, ?2, ?3, ?4 FROM sessions WHERE code = ?1";
    let mut statement = connection.prepare_cached(insert)?;
    if statement.execute(params![code, envelope.seq, now_ms(), text])? == 1 {
        return Ok(());
    }
    let session = connection.query_row("SELECT 1 FROM sessions WHERE code = ?1", [code], |_| Ok(()));
    Err(match session.optional()? {
        Some(()) => StoreError::Conflict { code: code.to_owned(), seq: envelope.seq },
        None => StoreError::Unknown(code.to_owned()),
    })
}

pub(super) fn event(connection: &Connection, code: &str, seq: u64) -> Result<Option<Envelope>, StoreError> {
    let query = "SELECT envelope FROM events WHERE code = ?1 AND seq = ?2";
    let found = connection.query_row(query, params![code, seq], |row| row.get::<_, String>(0)).optional()?;
    found.map(|text| parse(&text, code, seq)).transpose()
}

fn parse(text: &str, code: &str, seq: u64) -> Result<Envelope, StoreError> {
    let bad = |what: String| StoreError::Event { code: code.to_owned(), seq, what };
    serde_json::from_str(text).map_err(|e| bad(e.to_string()))
}

pub(super) fn load(connection: &Connection, code: &str) -> Result<SessionRecord, StoreError> {
    let query = "SELECT seed, observers, simulated, begun_ms, ids, plan
                 FROM sessions JOIN plans USING (code) WHERE code = ?1";
    let mut statement = connection.prepare_cached(query)?;
    let mut found = statement.query([code])?;
    let row = found.next()?.ok_or_else(|| StoreError::Unknown(code.to_owned()))?;
    let plan = serde_json::from_str(&row.get::<_, String>(5)?);
    let mut record = SessionRecord {
        code: code.to_owned(),
        seed: row.get::<_, i64>(0)? as u64,
        group: row.get(1)?,
        simulated: row.get(2)?,
        begun_ms: row.get(3)?,
        ids: serde_json::from_str(&row.get::<_, String>(4)?).unwrap_or_default(),
        received_ms: Vec::new(),
        plan: plan.map_err(|_| StoreError::Plan { code: code.to_owned() })?,
        events: Vec::new(),
    };
    let query = "SELECT seq, received_ms, envelope FROM events WHERE code = ?1 ORDER BY seq";
    let mut statement = connection.prepare_cached(query)?;
    let rows = statement.query_map([code], |row| Ok((row.get(0)?, row.get(1)?, row.get::<_, String>(2)?)))?;
    for row in rows {
        let (seq, received, text): (u64, u64, String) = row?;
        record.received_ms.push(received);
        record.events.push(parse(&text, code, seq)?);
    }
    Ok(record)
}

pub(super) fn erase(connection: &Connection, code: &str) -> Result<(), StoreError> {
    connection.execute("DELETE FROM events WHERE code = ?1", [code])?;
    // Used up: it does not begin another session
    connection.execute("DELETE FROM links WHERE code = ?1", [code])?;
    match connection.execute("DELETE FROM sessions WHERE code = ?1", [code])? {
        0 => Err(StoreError::Unknown(code.to_owned())),
        _ => Ok(()),
    }
}

/// Rewrites the database, and truncates its log, so that nothing of erased rows remains: `secure_delete` does
/// not reach the copies that stay in a page when its rows move to another one. If a reader prevents this, the
/// next erasure does it.
pub(super) fn scrub(connection: &Connection) {
    let done = connection.execute_batch("VACUUM; PRAGMA wal_checkpoint(TRUNCATE)");
    drop(done);
}
