//! Database files: their marks and tables, and how they are opened.

use crate::error::StoreError;
use rusqlite::{Connection, OpenFlags, OptionalExtension};
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// A kind of database, and how a file says that it is one.
pub(crate) struct Kind {
    /// `PRAGMA application_id`.
    pub(crate) application: i32,
    /// `PRAGMA user_version`: of the tables.
    pub(crate) version: i32,
    pub(crate) tables: &'static str,
    /// What is said of a file of another kind.
    pub(crate) other: fn() -> StoreError,
}

/// Whether a missing database is created.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Mode {
    Create,
    Existing,
}

impl Kind {
    /// Opens a database. Files of another kind are not touched. What is committed survives kills, and erased rows are
    /// overwritten with zeros.
    pub(crate) fn open(&self, path: &Path, mode: Mode) -> Result<Connection, StoreError> {
        // Without the CREATE flag, a missing file is an error
        let mut flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        flags.set(OpenFlags::SQLITE_OPEN_CREATE, mode == Mode::Create);
        let connection = Connection::open_with_flags(path, flags)?;
        connection.busy_timeout(Duration::from_secs(10))?;
        let tables: i64 = connection.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))?;
        if tables == 0 && mode == Mode::Create {
            connection.pragma_update(None, "application_id", self.application)?;
            connection.pragma_update(None, "user_version", self.version)?;
        }
        let pragma = |name: &str| connection.pragma_query_value(None, name, |row| row.get::<_, i32>(0));
        if (pragma("application_id")?, pragma("user_version")?) != (self.application, self.version) {
            return Err((self.other)());
        }
        connection.pragma_update(None, "journal_mode", "WAL")?;
        connection.pragma_update(None, "synchronous", "FULL")?;
        connection.pragma_update(None, "secure_delete", true)?;
        connection.pragma_update(None, "foreign_keys", true)?;
        connection.execute_batch(self.tables)?;
        Ok(connection)
    }
}

/// Answers to a study: "nfst".
const ANSWERS: Kind = Kind {
    application: 0x6e66_7374,
    version: 3,
    other: || StoreError::OtherStudy,
    tables: "
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
) STRICT, WITHOUT ROWID;",
};

/// Opens the answers of a study of this design, and of no other.
pub(super) fn open(path: &Path, mode: Mode, design: &str) -> Result<Connection, StoreError> {
    let connection = ANSWERS.open(path, mode)?;
    if mode == Mode::Create {
        connection.execute("INSERT OR IGNORE INTO design VALUES (1, ?1)", [design])?;
    }
    let query = "SELECT text FROM design";
    let kept: Option<String> = connection.query_row(query, [], |row| row.get(0)).optional()?;
    if kept.as_deref() == Some(design) { Ok(connection) } else { Err(StoreError::OtherStudy) }
}

pub(crate) fn now_ms() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_millis() as u64)
}
