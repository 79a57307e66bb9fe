//! Work on a database that a server may be using at the same time.

use super::database::{Mode, open};
use super::record::SessionRecord;
use super::rows::{all_codes, erase, load, scrub};
use crate::code;
use crate::error::StoreError;
use rusqlite::{Connection, TransactionBehavior};
use std::path::Path;

/// Reads all sessions, in the order they began. The database may be in use by a server.
pub fn read_all(path: impl AsRef<Path>, design: &str) -> Result<Vec<SessionRecord>, StoreError> {
    within(path.as_ref(), Mode::Existing, design, |connection| {
        all_codes(connection)?.iter().map(|code| load(connection, code)).collect()
    })
}

/// Adds one-time links to the database of a study, creating it if needed. Returns their tokens.
pub fn make_links(path: impl AsRef<Path>, design: &str, count: u32) -> Result<Vec<String>, StoreError> {
    within(path.as_ref(), Mode::Create, design, |connection| {
        let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
        let tokens = (0..count).map(|_| code::draw()).collect::<Result<Vec<_>, _>>()?;
        for token in &tokens {
            transaction.execute("INSERT INTO links VALUES (?1, NULL)", [token])?;
        }
        transaction.commit()?;
        Ok(tokens)
    })
}

/// Copies a database, consistent even while a server writes to it. The copy is a database like the original:
/// to restore it, put it in the place of the original while no server runs.
pub fn back_up(path: impl AsRef<Path>, design: &str, to: impl AsRef<Path>) -> Result<(), StoreError> {
    let to = to.as_ref();
    within(path.as_ref(), Mode::Existing, design, |connection| {
        let copied = connection.execute("VACUUM INTO ?1", [to.to_string_lossy()]);
        copied.map(drop).map_err(|fault| StoreError::from(fault).at(to))
    })?;
    within(to, Mode::Existing, design, |copy| {
        let whole: String = copy.query_row("PRAGMA integrity_check", [], |row| row.get(0))?;
        if whole == "ok" { Ok(()) } else { Err(StoreError::OtherStudy) }
    })
}

/// Reads one session. The database may be in use by a server.
pub fn read_one(path: impl AsRef<Path>, design: &str, code: &str) -> Result<SessionRecord, StoreError> {
    within(path.as_ref(), Mode::Existing, design, |connection| load(connection, code))
}

/// Erases one session. The database may be in use by a server.
pub fn erase_one(path: impl AsRef<Path>, design: &str, code: &str) -> Result<(), StoreError> {
    within(path.as_ref(), Mode::Existing, design, |connection| {
        let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
        erase(&transaction, code)?;
        transaction.commit()?;
        scrub(connection);
        Ok(())
    })
}

fn within<T>(
    path: &Path,
    mode: Mode,
    design: &str,
    work: impl FnOnce(&mut Connection) -> Result<T, StoreError>,
) -> Result<T, StoreError> {
    open(path, mode, design).and_then(|mut connection| work(&mut connection)).map_err(|fault| fault.at(path))
}
