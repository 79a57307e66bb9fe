//! Progress of long work, for display.

/// How far a piece of work is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Advance<'a> {
    /// What is counted, such as `"zones cut into pairs"`. Another text begins another piece of work.
    pub what: &'static str,
    pub done: u64,
    pub of: u64,
    /// What is being worked on now; may be empty.
    pub detail: &'a str,
}

/// Called with progress, from any thread.
pub type Watch<'a> = &'a (dyn Fn(Advance<'_>) + Sync);
