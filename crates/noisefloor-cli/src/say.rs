//! What the command says: results on standard output, everything else on standard error.

use noisefloor::text::printable;
use serde::Serialize;
use std::borrow::Cow;
use std::fmt;
use std::io::{self, Write};

/// Standard output could not be written to.
#[derive(Debug)]
pub struct NotSaid(io::Error);

impl fmt::Display for NotSaid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "standard output cannot be written to: {}", self.0)
    }
}

impl std::error::Error for NotSaid {}

impl NotSaid {
    /// Whoever read our output has had enough (`noisefloor scenes | head -1`): that is no fault.
    pub(crate) fn nobody_reads(&self) -> bool {
        self.0.kind() == io::ErrorKind::BrokenPipe
    }
}

impl From<io::Error> for NotSaid {
    fn from(error: io::Error) -> Self {
        Self(error)
    }
}

/// Names and messages from outside may hold what a terminal would obey: it is shown instead.
fn safe(text: fmt::Arguments<'_>) -> String {
    printable(&text.to_string()).into_owned()
}

/// Writes to standard output, without a line end.
pub fn print(text: fmt::Arguments<'_>) -> Result<(), NotSaid> {
    Ok(io::stdout().lock().write_all(safe(text).as_bytes())?)
}

/// A value as JSON, where what a terminal would obey is escaped as JSON does it.
pub fn say_json(value: &impl Serialize) -> anyhow::Result<()> {
    let mut text = String::new();
    for c in serde_json::to_string_pretty(value)?.chars() {
        let safe = matches!(printable(c.encode_utf8(&mut [0; 4])), Cow::Borrowed(_));
        // All of them are in the basic plane
        if safe { text.push(c) } else { text.push_str(&format!("\\u{:04x}", u32::from(c))) }
    }
    Ok(print(format_args!("{text}\n"))?)
}

/// Whatever is left goes out.
pub fn flush() -> Result<(), NotSaid> {
    Ok(io::stdout().lock().flush()?)
}

/// Writes to standard error, where nothing can be done about a failure.
pub fn aside(text: fmt::Arguments<'_>) {
    let _ = io::stderr().lock().write_all(safe(text).as_bytes());
}

/// A line of results, as `println!`; fails with [`NotSaid`].
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => {
        $crate::say::print(format_args!("{}\n", format_args!($($text)*)))
    };
}

/// A line for people beside the results, as `eprintln!`; never fails.
#[macro_export]
macro_rules! note {
    ($($text:tt)*) => {
        $crate::say::aside(format_args!("{}\n", format_args!($($text)*)))
    };
}

pub use crate::{note, say};

/// An error and its causes in one line; a cause that its parent already quotes is not repeated.
pub fn one_line(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if !line.contains(&cause) {
            if !line.is_empty() {
                line.push_str(": ");
            }
            line.push_str(&cause);
        }
    }
    // Names from outside may hold what a terminal would obey
    line.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_one_line_without_repetition() {
        let inner = anyhow::anyhow!("no such file");
        let error = inner.context("a.exr: no such file").context("the scene\ncannot be\u{1b}[2J read");
        assert_eq!(one_line(&error), "the scene cannot be [2J read: a.exr: no such file");
    }

    #[test]
    fn what_a_terminal_would_obey_is_shown() {
        assert_eq!(safe(format_args!("{}\n", "a\u{1b}[2J\u{202e}b")), "a\\u{1b}[2J\\u{202e}b\n");
    }
}
