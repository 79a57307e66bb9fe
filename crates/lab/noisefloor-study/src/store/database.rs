//! The database file: its tables, and how it is opened.

use crate::error::StoreError;
use rusqlite::{Connection, OpenFlags, OptionalExtension};
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// `PRAGMA application_id`: "nfst".
const APPLICATION: i32 = 0x6e66_7374;
/// `PRAGMA user_version`: version of the tables below.
const VERSION: i32 = 3;
/// Before the trials of sessions were stored.
const WITHOUT_PLANS: i32 = 2;
const TABLES: &str = "
CREATE TABLE IF NOT EXISTS design (only INTEGER PRIMARY KEY CHECK (only = 1), text TEXT NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS sessions (
    code TEXT PRIMARY KEY, seed INTEGER NOT NULL, observers TEXT NOT NULL, simulated INTEGER NOT NULL,
    begun_ms INTEGER NOT NULL, ids TEXT NOT NULL
) STRICT, WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS links (
    token TEXT PRIMARY KEY, code TEXT REFERENCES sessions (code) ON DELETE SET NULL
) STRICT, WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS plans (
    code TEXT PRIMARY KEY REFERENCES sessions (code) ON DELETE CASCADE, plan TEXT NOT NULL
) STRICT, WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS events (
    code TEXT NOT NULL REFERENCES sessions (code), seq INTEGER NOT NULL, received_ms INTEGER NOT NULL,
    envelope TEXT NOT NULL, PRIMARY KEY (code, seq)
) STRICT, WITHOUT ROWID;";

/// Whether a missing database is created.
#[derive(PartialEq)]
pub(super) enum Mode {
    Create,
    Existing,
}

pub(super) fn open(path: &Path, mode: Mode, design: &str) -> Result<Connection, StoreError> {
    // Without the CREATE flag, a missing file is an error
    let mut flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    flags.set(OpenFlags::SQLITE_OPEN_CREATE, mode == Mode::Create);
    let connection = Connection::open_with_flags(path, flags)?;
    settle(&connection)?;
    if mode == Mode::Create {
        claim(&connection, design)?;
    }
    let query = "SELECT text FROM design";
    let kept: Option<String> = connection.query_row(query, [], |row| row.get(0)).optional()?;
    if kept.as_deref() != Some(design) {
        return Err(StoreError::OtherStudy);
    }
    connection.execute_batch(TABLES)?;
    Ok(connection)
}

/// Marks an empty database, or one of an earlier version, as one of this program, for `design`.
fn claim(connection: &Connection, design: &str) -> Result<(), StoreError> {
    let pragma = |name: &str| connection.pragma_query_value(None, name, |row| row.get::<_, i32>(0));
    let (application, version) = (pragma("application_id")?, pragma("user_version")?);
    if application != APPLICATION || !(WITHOUT_PLANS..=VERSION).contains(&version) {
        let tables: i64 = connection.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))?;
        if tables > 0 {
            return Err(StoreError::OtherStudy);
        }
        connection.pragma_update(None, "application_id", APPLICATION)?;
    }
    if version != VERSION {
        connection.pragma_update(None, "user_version", VERSION)?;
    }
    connection.execute_batch(TABLES)?;
    connection.execute("INSERT OR IGNORE INTO design VALUES (1, ?1)", [design])?;
    Ok(())
}

/// Connection settings: a log that survives kills, and erased rows overwritten with zeros.
pub(crate) fn settle(connection: &Connection) -> rusqlite::Result<()> {
    connection.busy_timeout(Duration::from_secs(10))?;
    connection.pragma_update(None, "journal_mode", "WAL")?;
    connection.pragma_update(None, "synchronous", "FULL")?;
    connection.pragma_update(None, "secure_delete", true)?;
    connection.pragma_update(None, "foreign_keys", true)
}

pub(crate) fn now_ms() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_millis() as u64)
}
