//! Work on a database that a server may be using at the same time.

use super::database::{open, open_existing};
use super::record::SessionRecord;
use super::rows::{all_codes, erase, load, scrub};
use crate::code;
use crate::error::StoreError;
use rusqlite::TransactionBehavior;
use std::path::Path;

/// Reads all sessions, in the order they began. The database may be in use by a server.
pub fn read_all(path: impl AsRef<Path>, design: &str) -> Result<Vec<SessionRecord>, StoreError> {
    let path = path.as_ref();
    let connection = open_existing(path, design)?;
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    let codes = all_codes(&connection).map_err(failed)?;
    codes.iter().map(|code| load(&connection, path, code)).collect()
}

/// Adds one-time links to the database of a study, creating it if needed. Returns their tokens.
pub fn make_links(path: impl AsRef<Path>, design: &str, count: u32) -> Result<Vec<String>, StoreError> {
    let path = path.as_ref();
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    let mut connection = open(path, design)?;
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate).map_err(failed)?;
    let mut tokens = Vec::new();
    for _ in 0..count {
        let token = code::draw()?;
        transaction.execute("INSERT INTO links VALUES (?1, NULL)", [&token]).map_err(failed)?;
        tokens.push(token);
    }
    transaction.commit().map_err(failed)?;
    Ok(tokens)
}

/// Copies a database, consistent even while a server writes to it. The copy is a database like the original:
/// to restore it, put it in the place of the original while no server runs.
pub fn back_up(path: impl AsRef<Path>, design: &str, to: impl AsRef<Path>) -> Result<(), StoreError> {
    let (path, to) = (path.as_ref(), to.as_ref());
    let connection = open_existing(path, design)?;
    let failed = |source| StoreError::Database { path: to.to_owned(), source };
    connection.execute("VACUUM INTO ?1", [to.to_string_lossy()]).map_err(failed)?;
    let copy = open_existing(to, design)?;
    let whole: String = copy.query_row("PRAGMA integrity_check", [], |row| row.get(0)).map_err(failed)?;
    if whole == "ok" { Ok(()) } else { Err(StoreError::OtherStudy { path: to.to_owned() }) }
}

/// Reads one session. The database may be in use by a server.
pub fn read_one(path: impl AsRef<Path>, design: &str, code: &str) -> Result<SessionRecord, StoreError> {
    let path = path.as_ref();
    load(&open_existing(path, design)?, path, code)
}

/// Erases one session. The database may be in use by a server.
pub fn erase_one(path: impl AsRef<Path>, design: &str, code: &str) -> Result<(), StoreError> {
    let path = path.as_ref();
    let mut connection = open_existing(path, design)?;
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate).map_err(failed)?;
    erase(&transaction, path, code)?;
    transaction.commit().map_err(failed)?;
    scrub(&connection);
    Ok(())
}
