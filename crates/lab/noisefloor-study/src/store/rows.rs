//! What is read from and written to the tables, inside a transaction of the caller.

use super::database::now_ms;
use super::record::{NewSession, SessionRecord};
use crate::config::Study;
use crate::error::StoreError;
use crate::event::Envelope;
use crate::session::Plan;
use rusqlite::{Connection, OptionalExtension, Row, params};
use std::path::Path;

pub(super) fn all_codes(connection: &Connection) -> rusqlite::Result<Vec<String>> {
    let mut query = connection.prepare("SELECT code FROM sessions ORDER BY begun_ms, code")?;
    query.query_map([], |row| row.get(0))?.collect()
}

pub(super) fn begin(
    connection: &Connection,
    path: &Path,
    session: &NewSession,
) -> Result<String, StoreError> {
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    let NewSession { code, seed, plan, group, simulated, ids, link } = session;
    if let Some(token) = link {
        let query = "SELECT code FROM links WHERE token = ?1";
        let found = connection.query_row(query, [token], |row| row.get::<_, Option<String>>(0)).optional();
        match found.map_err(failed)? {
            None => return Err(StoreError::NoLink),
            Some(Some(begun)) => return Ok(begun),
            Some(None) => {}
        }
    }
    let ids = serde_json::to_string(ids).unwrap_or_default();
    // SQLite integers are signed; the bit pattern is stored
    let insert = "INSERT INTO sessions VALUES (?1, ?2, ?3, ?4, ?5, ?6)";
    let row = params![code, *seed as i64, group, simulated, now_ms(), ids];
    connection.execute(insert, row).map_err(failed)?;
    keep_plan(connection, code, plan).map_err(failed)?;
    if let Some(token) = link {
        connection.execute("UPDATE links SET code = ?2 WHERE token = ?1", [token, code]).map_err(failed)?;
    }
    Ok(code.clone())
}

fn keep_plan(connection: &Connection, code: &str, plan: &Plan) -> rusqlite::Result<()> {
    let text = serde_json::to_string(plan).unwrap_or_default();
    connection.execute("INSERT INTO plans VALUES (?1, ?2)", [code, &text]).map(drop)
}

/// Draws and keeps the plans of sessions that have only the seed of theirs.
pub(super) fn keep_plans(connection: &Connection, path: &Path, study: &Study) -> Result<(), StoreError> {
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    let query = "SELECT code, seed FROM sessions WHERE code NOT IN (SELECT code FROM plans)";
    let mut statement = connection.prepare(query).map_err(failed)?;
    let without = statement
        .query_map([], |row| Ok((row.get(0)?, row.get::<_, i64>(1)? as u64)))
        .and_then(Iterator::collect::<rusqlite::Result<Vec<(String, u64)>>>)
        .map_err(failed)?;
    without
        .iter()
        .try_for_each(|(code, seed)| keep_plan(connection, code, &Plan::draw(study, *seed)))
        .map_err(failed)
}

pub(super) fn append(
    connection: &Connection,
    path: &Path,
    code: &str,
    envelope: &Envelope,
) -> Result<(), StoreError> {
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    let text = serde_json::to_string(envelope).unwrap_or_default();
    let insert = "INSERT OR IGNORE INTO events SELECT code, ?2, ?3, ?4 FROM sessions WHERE code = ?1";
    let mut statement = connection.prepare_cached(insert).map_err(failed)?;
    if statement.execute(params![code, envelope.seq, now_ms(), text]).map_err(failed)? == 1 {
        return Ok(());
    }
    if exists(connection, path, code)? {
        Err(StoreError::Conflict { code: code.to_owned(), seq: envelope.seq })
    } else {
        Err(StoreError::Unknown(code.to_owned()))
    }
}

pub(super) fn exists(connection: &Connection, path: &Path, code: &str) -> Result<bool, StoreError> {
    let query = "SELECT 1 FROM sessions WHERE code = ?1";
    let found = connection.query_row(query, [code], |_| Ok(())).optional();
    found.map(|f| f.is_some()).map_err(|source| StoreError::Database { path: path.to_owned(), source })
}

pub(super) fn event(
    connection: &Connection,
    path: &Path,
    code: &str,
    seq: u64,
) -> Result<Option<Envelope>, StoreError> {
    let query = "SELECT envelope FROM events WHERE code = ?1 AND seq = ?2";
    let found = connection.query_row(query, params![code, seq], |row| row.get::<_, String>(0)).optional();
    let text = found.map_err(|source| StoreError::Database { path: path.to_owned(), source })?;
    text.map(|text| parse(&text, code, seq)).transpose()
}

pub(super) fn parse(text: &str, code: &str, seq: u64) -> Result<Envelope, StoreError> {
    let bad = |what: String| StoreError::Event { code: code.to_owned(), seq, what };
    serde_json::from_str(text).map_err(|e| bad(e.to_string()))
}

pub(super) fn load(connection: &Connection, path: &Path, code: &str) -> Result<SessionRecord, StoreError> {
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    let query = "SELECT seed, observers, simulated, begun_ms, ids, plan
                 FROM sessions LEFT JOIN plans USING (code) WHERE code = ?1";
    let mut plan = None;
    let record = |row: &Row<'_>| {
        plan = row.get::<_, Option<String>>(5)?;
        Ok(SessionRecord {
            code: code.to_owned(),
            seed: row.get::<_, i64>(0)? as u64,
            group: row.get(1)?,
            simulated: row.get(2)?,
            begun_ms: row.get(3)?,
            ids: serde_json::from_str(&row.get::<_, String>(4)?).unwrap_or_default(),
            received_ms: Vec::new(),
            plan: None,
            events: Vec::new(),
        })
    };
    let found = connection.query_row(query, [code], record).optional().map_err(failed)?;
    let mut record = found.ok_or_else(|| StoreError::Unknown(code.to_owned()))?;
    let parsed = plan.map(|text| serde_json::from_str(&text)).transpose();
    record.plan = parsed.map_err(|_| StoreError::Plan { code: code.to_owned() })?;
    let query = "SELECT seq, received_ms, envelope FROM events WHERE code = ?1 ORDER BY seq";
    let mut statement = connection.prepare_cached(query).map_err(failed)?;
    let rows = statement
        .query_map([code], |row| Ok((row.get(0)?, row.get(1)?, row.get::<_, String>(2)?)))
        .and_then(Iterator::collect::<rusqlite::Result<Vec<(u64, u64, String)>>>)
        .map_err(failed)?;
    for (seq, received, text) in rows {
        record.received_ms.push(received);
        record.events.push(parse(&text, code, seq)?);
    }
    Ok(record)
}

pub(super) fn erase(connection: &Connection, path: &Path, code: &str) -> Result<(), StoreError> {
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    connection.execute("DELETE FROM events WHERE code = ?1", [code]).map_err(failed)?;
    // Used up: it does not begin another session
    connection.execute("DELETE FROM links WHERE code = ?1", [code]).map_err(failed)?;
    match connection.execute("DELETE FROM sessions WHERE code = ?1", [code]).map_err(failed)? {
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
