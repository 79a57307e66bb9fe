//! How a command ends.

use crate::say::{self, NotSaid, note, one_line};
use clap::error::ErrorKind;
use std::fmt;
use std::process::ExitCode;

/// Exit code where the answer to a question is no, and the code was asked for (`--check`): nothing has failed.
pub const ANSWER_IS_NO: u8 = 3;

/// What was typed has to be typed otherwise: exit code 2.
#[derive(Debug)]
pub struct Usage(pub String);

impl fmt::Display for Usage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Usage {}

/// Ends a function with [`Usage`], as `bail!` does with any error.
#[macro_export]
macro_rules! refuse {
    ($($text:tt)*) => {
        return Err($crate::end::Usage(format!($($text)*)).into())
    };
}

/// Runs what was parsed, and says what went wrong, in one line. A broken pipe is not an error.
pub fn run<C>(
    parsed: anyhow::Result<Result<C, clap::Error>>,
    run: impl FnOnce(C) -> anyhow::Result<ExitCode>,
) -> ExitCode {
    let outcome = match parsed {
        Err(error) => Err(error),
        Ok(Ok(command)) => run(command),
        // Help and version are no errors
        Ok(Err(said)) => {
            let code = u8::try_from(said.exit_code()).unwrap_or(2);
            said.print().map(|()| ExitCode::from(code)).map_err(|error| NotSaid::from(error).into())
        }
    };
    let outcome = outcome.and_then(|code| say::flush().map(|()| code).map_err(Into::into));
    outcome.unwrap_or_else(|error| {
        if error.chain().filter_map(|cause| cause.downcast_ref::<NotSaid>()).any(NotSaid::nobody_reads) {
            return ExitCode::SUCCESS;
        }
        note!("error: {}", one_line(&error));
        if error.is::<Usage>() { ExitCode::from(2) } else { ExitCode::FAILURE }
    })
}

/// Says where a command is that the other binary has, or that has moved: `elsewhere` lists each with what
/// to type.
pub fn elsewhere(
    error: clap::Error,
    typed: Option<&str>,
    elsewhere: &[(&str, &str)],
) -> anyhow::Result<clap::Error> {
    let moved = typed.and_then(|typed| elsewhere.iter().find(|(name, _)| *name == typed));
    match moved.filter(|_| error.kind() == ErrorKind::InvalidSubcommand) {
        Some((name, again)) => refuse!("'{name}' is {again}"),
        None => Ok(error),
    }
}
