//! Answers on disk: SQLite, written by one thread.
//!
//! An event is acknowledged only after its transaction has been committed with `synchronous = FULL` in a
//! write-ahead log. It survives a kill of the process and, if the disk honours its write barriers, a power
//! failure. Events that arrive during a commit share the next one, so fifty observers cost hardly more than
//! one.

use crate::error::StoreError;
use crate::event::Envelope;
use rusqlite::{Connection, OpenFlags, OptionalExtension, TransactionBehavior, params};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio::sync::oneshot;

/// Most commands that share a commit; bounds what a failing disk can take with it.
const MOST_AT_ONCE: usize = 512;
/// `PRAGMA application_id`: "nfst".
const APPLICATION: i32 = 0x6e66_7374;
/// `PRAGMA user_version`: version of the tables below.
const VERSION: i32 = 1;
const TABLES: &str = "
CREATE TABLE IF NOT EXISTS design (only INTEGER PRIMARY KEY CHECK (only = 1), text TEXT NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS sessions (
    code TEXT PRIMARY KEY, seed INTEGER NOT NULL, observers TEXT NOT NULL, simulated INTEGER NOT NULL, begun_ms INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS events (
    code TEXT NOT NULL REFERENCES sessions (code), seq INTEGER NOT NULL, received_ms INTEGER NOT NULL, envelope TEXT NOT NULL,
    PRIMARY KEY (code, seq)
) STRICT, WITHOUT ROWID;";

/// One stored session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SessionRecord {
    /// The participant's code.
    pub code: String,
    /// Seed of the order of trials.
    pub seed: u64,
    /// Group of observers; empty if the study defines none.
    pub group: String,
    /// Whether the observer is a [`SimulatedObserver`](crate::simulated::SimulatedObserver), not a person.
    pub simulated: bool,
    /// Start of the session, in milliseconds since 1970.
    pub begun_ms: u64,
    /// All events, in order.
    pub events: Vec<Envelope>,
}

/// The answers of a study, open for writing. Clones share one writer thread.
#[derive(Clone, Debug)]
pub struct AnswerStore {
    commands: mpsc::Sender<Command>,
}

type Reply<T> = oneshot::Sender<Result<T, StoreError>>;

enum Command {
    Begin { code: String, seed: u64, group: String, simulated: bool, reply: Reply<()> },
    Append { code: String, envelope: Box<Envelope>, reply: Reply<()> },
    Load { code: String, reply: Reply<SessionRecord> },
    Event { code: String, seq: u64, reply: Reply<Option<Envelope>> },
    Erase { code: String, reply: Reply<()> },
}

impl AnswerStore {
    /// Opens the database of a study, creating it if needed. `design` identifies what the answers depend on
    /// ([`crate::Study::design`]).
    ///
    /// # Errors
    /// [`StoreError::Database`] if it cannot be opened, [`StoreError::OtherStudy`] if it belongs to another design.
    pub fn open(path: impl AsRef<Path>, design: &str) -> Result<Self, StoreError> {
        let path = path.as_ref().to_owned();
        let mut connection = open(&path, design)?;
        let (commands, received) = mpsc::channel();
        let work = move || write(&mut connection, &path, &received);
        std::thread::Builder::new().name("answers".into()).spawn(work).map_err(|_| StoreError::Closed)?;
        Ok(Self { commands })
    }

    /// Begins a session.
    ///
    /// # Errors
    /// [`StoreError`] if it could not be stored.
    pub async fn begin(&self, code: &str, seed: u64, group: &str, simulated: bool) -> Result<(), StoreError> {
        let (code, group) = (code.to_owned(), group.to_owned());
        self.ask(|reply| Command::Begin { code, seed, group, simulated, reply }).await
    }

    /// Stores an event. It is on disk when this returns.
    ///
    /// # Errors
    /// [`StoreError::Unknown`] if the session does not exist or was erased, [`StoreError::Conflict`] if the
    /// number is taken.
    pub async fn append(&self, code: &str, envelope: Envelope) -> Result<(), StoreError> {
        let (code, envelope) = (code.to_owned(), Box::new(envelope));
        self.ask(|reply| Command::Append { code, envelope, reply }).await
    }

    /// Loads a session with all its events.
    ///
    /// # Errors
    /// [`StoreError::Unknown`] if it is not there.
    pub async fn load(&self, code: &str) -> Result<SessionRecord, StoreError> {
        let code = code.to_owned();
        self.ask(|reply| Command::Load { code, reply }).await
    }

    /// Loads one event of a session, if it exists.
    ///
    /// # Errors
    /// [`StoreError`] if the database cannot be read.
    pub async fn event(&self, code: &str, seq: u64) -> Result<Option<Envelope>, StoreError> {
        let code = code.to_owned();
        self.ask(|reply| Command::Event { code, seq, reply }).await
    }

    /// Erases a session and all its events, including their traces in free pages and the log.
    ///
    /// # Errors
    /// [`StoreError::Unknown`] if it is not there.
    pub async fn erase(&self, code: &str) -> Result<(), StoreError> {
        let code = code.to_owned();
        self.ask(|reply| Command::Erase { code, reply }).await
    }

    async fn ask<T>(&self, command: impl FnOnce(Reply<T>) -> Command) -> Result<T, StoreError> {
        let (reply, answer) = oneshot::channel();
        self.commands.send(command(reply)).map_err(|_| StoreError::Closed)?;
        answer.await.map_err(|_| StoreError::Closed)?
    }
}

/// Reads all sessions, in the order they began. The database may be in use by a server.
///
/// # Errors
/// [`StoreError`] if it is not there or belongs to another study.
pub fn read_all(path: impl AsRef<Path>, design: &str) -> Result<Vec<SessionRecord>, StoreError> {
    let path = path.as_ref();
    let connection = open_existing(path, design)?;
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    let mut query =
        connection.prepare("SELECT code FROM sessions ORDER BY begun_ms, code").map_err(failed)?;
    let codes: Vec<String> =
        query.query_map([], |row| row.get(0)).and_then(Iterator::collect).map_err(failed)?;
    codes.iter().map(|code| load(&connection, path, code)).collect()
}

/// Reads one session. The database may be in use by a server.
///
/// # Errors
/// [`StoreError`] if it is not there or the database belongs to another study.
pub fn read_one(path: impl AsRef<Path>, design: &str, code: &str) -> Result<SessionRecord, StoreError> {
    let path = path.as_ref();
    load(&open_existing(path, design)?, path, code)
}

/// Erases one session. The database may be in use by a server.
///
/// # Errors
/// [`StoreError`] if it is not there or the database belongs to another study.
pub fn erase_one(path: impl AsRef<Path>, design: &str, code: &str) -> Result<(), StoreError> {
    let path = path.as_ref();
    let mut connection = open_existing(path, design)?;
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate).map_err(failed)?;
    erase(&transaction, path, code)?;
    transaction.commit().map_err(failed)?;
    truncate_log(&connection);
    Ok(())
}

fn open_existing(path: &Path, design: &str) -> Result<Connection, StoreError> {
    // Without the CREATE flag, a missing file is an error
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let made = Connection::open_with_flags(path, flags);
    made.and_then(|c| settle(&c).map(|()| c))
        .map_err(|source| StoreError::Database { path: path.to_owned(), source })
        .and_then(|connection| check_design(&connection, path, design).map(|()| connection))
}

fn open(path: &Path, design: &str) -> Result<Connection, StoreError> {
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    let connection = Connection::open(path).map_err(failed)?;
    settle(&connection).map_err(failed)?;
    let pragma = |name: &str| connection.pragma_query_value(None, name, |row| row.get::<_, i32>(0));
    let (application, version) =
        (pragma("application_id").map_err(failed)?, pragma("user_version").map_err(failed)?);
    if (application, version) != (APPLICATION, VERSION) {
        let tables: i64 = connection
            .query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))
            .map_err(failed)?;
        if tables > 0 {
            return Err(StoreError::OtherStudy { path: path.to_owned() });
        }
        connection.pragma_update(None, "application_id", APPLICATION).map_err(failed)?;
        connection.pragma_update(None, "user_version", VERSION).map_err(failed)?;
    }
    connection.execute_batch(TABLES).map_err(failed)?;
    connection.execute("INSERT OR IGNORE INTO design VALUES (1, ?1)", [design]).map_err(failed)?;
    check_design(&connection, path, design)?;
    Ok(connection)
}

/// Connection settings: a log that survives kills, and erased rows overwritten with zeros.
pub(crate) fn settle(connection: &Connection) -> rusqlite::Result<()> {
    connection.busy_timeout(Duration::from_secs(10))?;
    connection.pragma_update(None, "journal_mode", "WAL")?;
    connection.pragma_update(None, "synchronous", "FULL")?;
    connection.pragma_update(None, "secure_delete", true)?;
    connection.pragma_update(None, "foreign_keys", true)
}

fn check_design(connection: &Connection, path: &Path, design: &str) -> Result<(), StoreError> {
    let kept: Option<String> = connection
        .query_row("SELECT text FROM design", [], |row| row.get(0))
        .optional()
        .map_err(|source| StoreError::Database { path: path.to_owned(), source })?;
    if kept.as_deref() == Some(design) {
        Ok(())
    } else {
        Err(StoreError::OtherStudy { path: path.to_owned() })
    }
}

pub(crate) fn now_ms() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_millis() as u64)
}

/// A pending reply, sent after the commit.
type Held = Box<dyn FnOnce(Option<rusqlite::Error>) + Send>;

/// The writer thread; ends when every [`AnswerStore`] has been dropped.
fn write(connection: &mut Connection, path: &Path, commands: &mpsc::Receiver<Command>) {
    while let Ok(first) = commands.recv() {
        let mut erased = false;
        let mut batch = vec![first];
        batch.extend(commands.try_iter().take(MOST_AT_ONCE - 1));

        // One transaction for the batch; replies wait until it is on disk
        let mut held: Vec<Held> = Vec::with_capacity(batch.len());
        let transaction = match connection.transaction_with_behavior(TransactionBehavior::Immediate) {
            Ok(transaction) => transaction,
            Err(error) => {
                refuse(batch, path, &error);
                continue;
            }
        };
        for command in batch {
            erased |= matches!(command, Command::Erase { .. });
            held.push(run(&transaction, path, command));
        }
        let mut failure = transaction.commit().err();
        for answer in held {
            answer(failure.as_ref().map(copy));
        }
        if erased && failure.take().is_none() {
            truncate_log(connection);
        }
    }
}

/// SQLite errors cannot be cloned, and every waiting caller needs one.
fn copy(error: &rusqlite::Error) -> rusqlite::Error {
    match error {
        rusqlite::Error::SqliteFailure(code, text) => rusqlite::Error::SqliteFailure(*code, text.clone()),
        _ => rusqlite::Error::SqliteFailure(rusqlite::ffi::Error::new(1), Some(error.to_string())),
    }
}

fn refuse(batch: Vec<Command>, path: &Path, error: &rusqlite::Error) {
    let failed = || StoreError::Database { path: path.to_owned(), source: copy(error) };
    for command in batch {
        // A dropped receiver needs no reply
        match command {
            Command::Begin { reply, .. } | Command::Append { reply, .. } | Command::Erase { reply, .. } => {
                drop(reply.send(Err(failed())));
            }
            Command::Load { reply, .. } => drop(reply.send(Err(failed()))),
            Command::Event { reply, .. } => drop(reply.send(Err(failed()))),
        }
    }
}

fn hold<T: Send + 'static>(path: &Path, reply: Reply<T>, result: Result<T, StoreError>) -> Held {
    let path: PathBuf = path.to_owned();
    Box::new(move |failure| {
        let result = match failure {
            Some(source) => Err(StoreError::Database { path, source }),
            None => result,
        };
        drop(reply.send(result));
    })
}

fn run(connection: &Connection, path: &Path, command: Command) -> Held {
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    match command {
        Command::Begin { code, seed, group, simulated, reply } => {
            // SQLite integers are signed; the bit pattern is stored
            let insert = "INSERT INTO sessions VALUES (?1, ?2, ?3, ?4, ?5)";
            let done = connection.execute(insert, params![code, seed as i64, group, simulated, now_ms()]);
            hold(path, reply, done.map(drop).map_err(failed))
        }
        Command::Append { code, envelope, reply } => {
            hold(path, reply, append(connection, path, &code, &envelope))
        }
        Command::Load { code, reply } => hold(path, reply, load(connection, path, &code)),
        Command::Event { code, seq, reply } => hold(path, reply, event(connection, path, &code, seq)),
        Command::Erase { code, reply } => hold(path, reply, erase(connection, path, &code)),
    }
}

fn append(connection: &Connection, path: &Path, code: &str, envelope: &Envelope) -> Result<(), StoreError> {
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

fn exists(connection: &Connection, path: &Path, code: &str) -> Result<bool, StoreError> {
    let query = "SELECT 1 FROM sessions WHERE code = ?1";
    let found = connection.query_row(query, [code], |_| Ok(())).optional();
    found.map(|f| f.is_some()).map_err(|source| StoreError::Database { path: path.to_owned(), source })
}

fn event(connection: &Connection, path: &Path, code: &str, seq: u64) -> Result<Option<Envelope>, StoreError> {
    let query = "SELECT envelope FROM events WHERE code = ?1 AND seq = ?2";
    let found = connection.query_row(query, params![code, seq], |row| row.get::<_, String>(0)).optional();
    let text = found.map_err(|source| StoreError::Database { path: path.to_owned(), source })?;
    text.map(|text| parse(&text, code, seq)).transpose()
}

fn parse(text: &str, code: &str, seq: u64) -> Result<Envelope, StoreError> {
    let bad = |what: String| StoreError::Event { code: code.to_owned(), seq, what };
    serde_json::from_str(text).map_err(|e| bad(e.to_string()))
}

fn load(connection: &Connection, path: &Path, code: &str) -> Result<SessionRecord, StoreError> {
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    let query = "SELECT seed, observers, simulated, begun_ms FROM sessions WHERE code = ?1";
    let found = connection
        .query_row(query, [code], |row| {
            Ok((row.get::<_, i64>(0)?, row.get::<_, String>(1)?, row.get(2)?, row.get::<_, u64>(3)?))
        })
        .optional()
        .map_err(failed)?;
    let (seed, group, simulated, begun_ms) = found.ok_or_else(|| StoreError::Unknown(code.to_owned()))?;
    let query = "SELECT seq, envelope FROM events WHERE code = ?1 ORDER BY seq";
    let mut statement = connection.prepare_cached(query).map_err(failed)?;
    let rows = statement
        .query_map([code], |row| Ok((row.get::<_, u64>(0)?, row.get::<_, String>(1)?)))
        .and_then(Iterator::collect::<rusqlite::Result<Vec<_>>>)
        .map_err(failed)?;
    let events = rows.iter().map(|(seq, text)| parse(text, code, *seq)).collect::<Result<_, _>>()?;
    Ok(SessionRecord { code: code.to_owned(), seed: seed as u64, group, simulated, begun_ms, events })
}

fn erase(connection: &Connection, path: &Path, code: &str) -> Result<(), StoreError> {
    let failed = |source| StoreError::Database { path: path.to_owned(), source };
    connection.execute("DELETE FROM events WHERE code = ?1", [code]).map_err(failed)?;
    match connection.execute("DELETE FROM sessions WHERE code = ?1", [code]).map_err(failed)? {
        0 => Err(StoreError::Unknown(code.to_owned())),
        _ => Ok(()),
    }
}

/// Writes the log back and truncates it, so that no erased rows remain there. If a reader prevents this,
/// the next erasure or the end of the server does it.
fn truncate_log(connection: &Connection) {
    let done = connection.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(()));
    drop(done);
}
