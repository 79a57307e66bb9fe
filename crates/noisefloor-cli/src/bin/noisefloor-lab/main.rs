//! The `noisefloor-lab` command: models are trained and scored, criteria compared, and people asked. What
//! was typed ([`args`]) becomes a checked job, and the job is run by the module of its command.
#![allow(missing_docs, unreachable_pub, reason = "a command has no public items")]

mod args;
mod audience;
mod bars;
mod compare;
mod evaluate;
mod explore;
mod learning;
mod reproduce;
mod study;
mod train;

use args::{Cli, Command, ELSEWHERE};
use clap::{CommandFactory, Parser};
use noisefloor_cli::{end, manual};
use std::process::ExitCode;

fn main() -> ExitCode {
    let name = std::env::args().nth(1);
    let parsed = match Cli::try_parse() {
        Ok(cli) => Ok(Ok(cli.command)),
        Err(error) => end::elsewhere(error, name.as_deref(), ELSEWHERE).map(Err),
    };
    end::run(parsed, run)
}

fn run(command: Command) -> anyhow::Result<ExitCode> {
    let done = |()| ExitCode::SUCCESS;
    match command {
        Command::Compare(args) => compare::run(args.check()?),
        Command::Reproduce(args) => reproduce::run(args).map(done),
        Command::Train(args) => train::run(args).map(done),
        Command::Evaluate(args) => evaluate::run(&args.check()?).map(done),
        Command::Audience(args) => audience::run(args).map(done),
        Command::Explore(args) => explore::run(args.check()?).map(done),
        Command::Study(args) => study::run(args.command).map(done),
        Command::Completions { shell } => manual::completions(Cli::command(), shell).map(done),
        Command::Man { dir } => manual::man(Cli::command(), &dir).map(done),
    }
}
