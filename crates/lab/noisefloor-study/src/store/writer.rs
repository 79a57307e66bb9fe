//! The thread that writes.

use super::database::{Mode, open};
use super::record::{NewSession, SessionRecord};
use super::rows::{all_codes, append, begin, erase, event, load, scrub};
use crate::error::StoreError;
use crate::event::Envelope;
use rusqlite::{Connection, TransactionBehavior};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::sync::{Arc, mpsc};
use tokio::sync::oneshot;

/// Most commands that share a commit; bounds what is lost if the disk fails.
const MOST_AT_ONCE: usize = 512;
/// The answers of a study, open for writing. Clones share one writer thread.
#[derive(Clone, Debug)]
pub struct AnswerStore {
    commands: mpsc::Sender<Command>,
    path: Arc<Path>,
}

struct Command {
    /// Whether it erases rows.
    erases: bool,
    work: Work,
}

/// Runs in a transaction, or in none if none could be begun.
type Work = Box<dyn FnOnce(Result<&Connection, rusqlite::Error>) -> Held + Send>;

/// A pending reply, sent after the commit with its failure, if any.
type Held = Box<dyn FnOnce(Option<rusqlite::Error>) + Send>;

impl AnswerStore {
    /// Opens the database of a study, creating it if needed. `design` identifies what the answers depend on
    /// ([`crate::Study::design`]).
    pub fn open(path: impl AsRef<Path>, design: &str) -> Result<Self, StoreError> {
        let path: Arc<Path> = path.as_ref().into();
        // A log that is left is of a server that was killed: perhaps before it had removed what it erased
        let log = PathBuf::from([path.as_os_str(), OsStr::new("-wal")].into_iter().collect::<OsString>());
        let killed = std::fs::metadata(log).is_ok_and(|log| log.len() > 0);
        let mut connection = open(&path, Mode::Create, design).map_err(|fault| fault.at(&path))?;
        if killed {
            scrub(&connection);
        }
        let (commands, received) = mpsc::channel();
        let work = move || write(&mut connection, &received);
        std::thread::Builder::new().name("answers".into()).spawn(work).map_err(|_| StoreError::Closed)?;
        Ok(Self { commands, path })
    }

    /// Begins a session and returns its code. A link that was used before leads to the session it began.
    pub async fn begin(&self, session: NewSession) -> Result<String, StoreError> {
        self.ask(false, move |connection| begin(connection, &session)).await
    }

    /// The codes of all sessions, in the order they began.
    pub async fn codes(&self) -> Result<Vec<String>, StoreError> {
        self.ask(false, |connection| Ok(all_codes(connection)?)).await
    }

    /// Stores an event. It is on disk when this returns.
    pub(crate) async fn append(&self, code: &str, envelope: Envelope) -> Result<(), StoreError> {
        let code = code.to_owned();
        self.ask(false, move |connection| append(connection, &code, &envelope)).await
    }

    /// Loads a session with all its events.
    pub async fn load(&self, code: &str) -> Result<SessionRecord, StoreError> {
        let code = code.to_owned();
        self.ask(false, move |connection| load(connection, &code)).await
    }

    /// Loads one event of a session, if it exists.
    pub async fn event(&self, code: &str, seq: u64) -> Result<Option<Envelope>, StoreError> {
        let code = code.to_owned();
        self.ask(false, move |connection| event(connection, &code, seq)).await
    }

    /// Erases a session and all its events, including their traces in free pages and the log.
    pub async fn erase(&self, code: &str) -> Result<(), StoreError> {
        let code = code.to_owned();
        self.ask(true, move |connection| erase(connection, &code)).await
    }

    async fn ask<T: Send + 'static>(
        &self,
        erases: bool,
        work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        let (reply, answer) = oneshot::channel();
        let work = |connection: Result<&Connection, rusqlite::Error>| -> Held {
            let result = connection.map_err(StoreError::from).and_then(work);
            Box::new(move |failure| {
                let result = failure.map_or(result, |failure| Err(failure.into()));
                // A dropped receiver needs no reply
                drop(reply.send(result));
            })
        };
        let command = Command { erases, work: Box::new(work) };
        self.commands.send(command).map_err(|_| StoreError::Closed)?;
        answer.await.map_err(|_| StoreError::Closed)?.map_err(|fault| fault.at(&self.path))
    }
}

/// The writer thread; ends when every [`AnswerStore`] has been dropped.
fn write(connection: &mut Connection, commands: &mpsc::Receiver<Command>) {
    while let Ok(first) = commands.recv() {
        let mut batch = vec![first];
        batch.extend(commands.try_iter().take(MOST_AT_ONCE - 1));
        let erased = batch.iter().any(|command| command.erases);

        // One transaction for the batch; replies wait until it is on disk
        let (held, failure): (Vec<Held>, _) =
            match connection.transaction_with_behavior(TransactionBehavior::Immediate) {
                Ok(transaction) => {
                    let held = batch.into_iter().map(|command| (command.work)(Ok(&transaction))).collect();
                    (held, transaction.commit().err())
                }
                Err(error) => {
                    let refused = batch.into_iter().map(|command| (command.work)(Err(copy(&error))));
                    (refused.collect(), Some(error))
                }
            };
        // An erasure is acknowledged when nothing is left of it, in the log either
        if erased && failure.is_none() {
            scrub(connection);
        }
        for answer in held {
            answer(failure.as_ref().map(copy));
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Sixteen bytes that stand nowhere else.
    const IDENTIFIER: &str = "IDENTIFIER-4711-";

    fn session(code: &str) -> NewSession {
        let ids = BTreeMap::from([("PROLIFIC_PID".to_owned(), IDENTIFIER.repeat(20))]);
        let plan = serde_json::from_str(r#"{"practice":[],"trials":[]}"#).unwrap();
        let (code, group) = (code.into(), String::new());
        NewSession { code, seed: 1, plan, group, simulated: false, ids, link: None }
    }

    /// The files of a database that still name the participant.
    fn traces(database: &Path) -> Vec<PathBuf> {
        let named = |path: &PathBuf| {
            let bytes = std::fs::read(path).unwrap_or_default();
            bytes.windows(IDENTIFIER.len()).any(|window| window == IDENTIFIER.as_bytes())
        };
        let files = std::fs::read_dir(database.parent().unwrap()).unwrap().map(|entry| entry.unwrap().path());
        files.filter(named).collect()
    }

    /// When an erasure is acknowledged, nothing is left of it, even if the server is killed right then.
    #[tokio::test]
    async fn an_erasure_is_acknowledged_when_it_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("answers.sqlite");
        let store = AnswerStore::open(&path, "a design").unwrap();
        for round in 0..20 {
            let code = store.begin(session(&format!("CODE{round:08}"))).await.unwrap();
            assert!(!traces(&path).is_empty());
            store.erase(&code).await.unwrap();
            assert_eq!(traces(&path), Vec::<PathBuf>::new(), "round {round}");
        }
    }

    /// A server killed between the two finishes the erasure when it starts again.
    #[test]
    fn what_a_killed_server_left_of_an_erasure_goes_at_the_next_start() {
        let folder = tempfile::tempdir().unwrap();
        let [there, copy] = ["there", "copy"].map(|name| folder.path().join(name));
        for folder in [&there, &copy] {
            std::fs::create_dir(folder).unwrap();
        }
        let path = there.join("answers.sqlite");
        let connection = open(&path, Mode::Create, "a design").unwrap();
        begin(&connection, &session("CODE00000000")).unwrap();
        erase(&connection, "CODE00000000").unwrap();
        // What a kill leaves
        for file in ["answers.sqlite", "answers.sqlite-wal"] {
            std::fs::copy(there.join(file), copy.join(file)).unwrap();
        }
        let path = copy.join("answers.sqlite");
        assert!(!traces(&path).is_empty());
        let store = AnswerStore::open(&path, "a design").unwrap();
        assert_eq!(traces(&path), Vec::<PathBuf>::new());
        drop(store);
    }
}
