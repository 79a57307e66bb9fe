//! The `noisefloor` command, in three steps: what was typed ([`args`]) becomes a checked job, and the job
//! is run by the module of its command. Libraries do the work; nothing here computes.
#![allow(missing_docs, unreachable_pub, reason = "a command has no public items")]

mod args;
#[cfg(feature = "train")]
mod audience;
mod bars;
#[cfg(feature = "lab")]
mod compare;
#[cfg(feature = "adapters")]
mod doctor;
#[cfg(feature = "train")]
mod evaluate;
#[cfg(feature = "study")]
mod explore;
#[cfg(feature = "farm")]
mod farm;
mod files;
mod folder;
mod inspect;
mod judge;
#[cfg(feature = "train")]
mod learning;
mod left_out;
mod metrics;
mod output;
mod reference;
mod render;
#[cfg(feature = "lab")]
mod reproduce;
mod say;
mod scenes;
mod signals;
mod sources;
#[cfg(feature = "study")]
mod study;
#[cfg(feature = "train")]
mod train;

use args::{Cli, Command, ScenesCommand};
use clap::Parser;
use folder::Occupied;
use left_out::LeftOut;
use say::{NotSaid, note, one_line};
use std::process::ExitCode;

fn main() -> ExitCode {
    let outcome = match args::expand(std::env::args_os().collect()).map(Cli::try_parse_from) {
        Err(error) => Err(error),
        Ok(Ok(cli)) => run(cli.command),
        // Help and version are no errors; what was typed wrong has exit code 2
        Ok(Err(said)) => {
            let code = u8::try_from(said.exit_code()).unwrap_or(2);
            said.print().map(|()| ExitCode::from(code)).map_err(|error| NotSaid::from(error).into())
        }
    };
    let outcome = outcome.and_then(|code| say::flush().map(|()| code).map_err(Into::into));
    outcome.unwrap_or_else(|error| end(&error))
}

fn run(command: Command) -> anyhow::Result<ExitCode> {
    match command {
        Command::Render(args) if args.is_sequence() => render::render_frames(&args.check_frames()?),
        Command::Render(args) => render::run(args.check()?),
        Command::Reference(args) => reference::run(args.check()?),
        Command::Judge(args) => judge::run(&args.check()?).map(done),
        Command::Metrics(args) => metrics::run(&args.check()?).map(done),
        Command::Inspect(args) => inspect::run(&args.check()?).map(done),
        Command::Scenes { command: None } => Ok(inspect::scenes().map(done)?),
        Command::Scenes { command: Some(ScenesCommand::Check(args)) } => scenes::check(args),
        #[cfg(feature = "farm")]
        Command::Farm(args) => farm::run(args),
        #[cfg(feature = "farm")]
        Command::Merge(args) => farm::merge(args),
        #[cfg(feature = "adapters")]
        Command::Doctor(args) => doctor::run(&args.check()),
        #[cfg(feature = "lab")]
        Command::Compare(args) => compare::run(args.check()?),
        #[cfg(feature = "lab")]
        Command::Reproduce(args) => reproduce::run(&args.check()).map(done),
        #[cfg(feature = "train")]
        Command::Train(args) => train::run(&args.check()?).map(done),
        #[cfg(feature = "train")]
        Command::Evaluate(args) => evaluate::run(&args.check()?).map(done),
        #[cfg(feature = "train")]
        Command::Audience(args) => audience::fit(&args.check()).map(done),
        #[cfg(feature = "study")]
        Command::Explore(args) => explore::run(args.check()?).map(done),
        #[cfg(feature = "study")]
        Command::Study(args) => study::run(args.check()?).map(done),
        #[cfg(not(feature = "full"))]
        command => Err(left_out(&command).into()),
    }
}

fn done((): ()) -> ExitCode {
    ExitCode::SUCCESS
}

/// What to type for a command that is not in this build.
#[cfg_attr(feature = "full", allow(dead_code, reason = "a full build leaves out nothing"))]
fn left_out(command: &Command) -> LeftOut {
    let (what, feature, again) = match command {
        Command::Farm(_) => ("farm", "farm", "farm …"),
        Command::Merge(_) => ("merge", "farm", "merge …"),
        Command::Doctor(_) => ("doctor", "adapters", "doctor …"),
        Command::Compare(_) => ("compare", "lab", "compare …"),
        Command::Reproduce(_) => ("reproduce", "lab", "reproduce …"),
        Command::Train(_) => ("train", "train", "train …"),
        Command::Evaluate(_) => ("evaluate", "train", "evaluate …"),
        Command::Audience(_) => ("audience", "train", "audience …"),
        Command::Explore(_) => ("explore", "study", "explore …"),
        Command::Study(_) => ("study", "study", "study …"),
        _ => ("this command", "full", "…"),
    };
    LeftOut { what, feature, again }
}

/// Says what went wrong, in one line. Nothing is wrong if only nobody reads our output any more.
fn end(error: &anyhow::Error) -> ExitCode {
    let unsaid = error.chain().find_map(|cause| cause.downcast_ref::<NotSaid>());
    if unsaid.is_some_and(NotSaid::nobody_reads) {
        return ExitCode::SUCCESS;
    }
    note!("error: {}", one_line(error));
    // What was typed has to be typed otherwise
    let usage = error.is::<LeftOut>() || error.is::<Occupied>();
    if usage { ExitCode::from(2) } else { ExitCode::FAILURE }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As `tests/command/left_out.rs` sees it in a build that leaves them out.
    #[test]
    fn what_is_left_out_says_what_to_type() {
        for (typed, feature) in [
            ("farm status absent", "farm"),
            ("merge absent.nfs --out out", "farm"),
            ("doctor", "adapters"),
            ("compare cornell-box", "lab"),
            ("reproduce --corpus absent", "lab"),
            ("train --corpus absent --out my.nfm", "train"),
            ("evaluate --corpus absent", "train"),
            ("audience fit absent.csv", "train"),
            ("explore", "study"),
            ("study serve absent.toml", "study"),
        ] {
            let cli = Cli::try_parse_from(format!("noisefloor {typed}").split(' ')).unwrap();
            let name = typed.split(' ').next().unwrap_or_default();
            let again = format!("cargo run --release --features {feature} -- {name} …");
            let said = left_out(&cli.command).to_string();
            assert_eq!(said, format!("this build has no '{name}': run `{again}`"));
        }
    }
}
