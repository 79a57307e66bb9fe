//! Answers on disk: SQLite, written by one thread.
//!
//! An event is acknowledged only after its transaction has been committed with `synchronous = FULL` in a
//! write-ahead log. It survives a kill of the process and, if the disk honours its write barriers, a power
//! failure. Events that arrive during a commit share the next one, so fifty observers cost hardly more than
//! one.

mod database;
mod offline;
mod record;
mod rows;
mod writer;

pub use offline::{back_up, erase_one, make_links, read_all, read_one};
pub use record::{NewSession, SessionRecord};
pub use writer::AnswerStore;

pub(crate) use database::{Kind, Mode, now_ms};
