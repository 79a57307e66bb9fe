//! The `noisefloor` command, in three steps: what was typed ([`args`]) becomes a checked job, and the job
//! is run by the module of its command. Libraries do the work; nothing here computes.
#![allow(missing_docs, unreachable_pub, reason = "a command has no public items")]

mod args;
mod audit;
mod calibrate;
mod doctor;
mod farm;
mod inspect;
mod job;
mod judge;
mod metrics;
mod output;
mod reference;
mod render;
mod scenes;
mod tune;

use args::{Cli, Command, ELSEWHERE, ScenesCommand};
use noisefloor_cli::{end, manual};
use std::process::ExitCode;

fn main() -> ExitCode {
    let typed: Vec<_> = std::env::args_os().collect();
    let name = typed.get(1).and_then(|name| name.to_str()).map(str::to_owned);
    let parsed = args::expand(typed).and_then(|typed| match Cli::parsed(typed) {
        Ok(cli) => Ok(Ok(cli.command)),
        Err(error) => end::elsewhere(error, name.as_deref(), ELSEWHERE).map(Err),
    });
    end::run(parsed, run)
}

fn run(command: Command) -> anyhow::Result<ExitCode> {
    match command {
        Command::Render(args) if args.is_sequence() => render::render_frames(&args.check_frames()?),
        Command::Render(args) => render::run(&args.check()?),
        Command::Frame => render::one_frame(),
        Command::Tune(args) => tune::run(args.check()?),
        Command::Calibrate(args) => calibrate::run(args.check()?).map(done),
        Command::Farm(args) => farm::run(args.command),
        Command::Audit(args) => audit::run(&args.check()?),
        Command::Reference(args) => reference::run(args),
        Command::Judge(args) => judge::run(&args.check()?),
        Command::Metrics(args) => metrics::run(&args).map(done),
        Command::Inspect(args) => inspect::run(&args).map(done),
        Command::Scenes { command: None } => Ok(inspect::scenes().map(done)?),
        Command::Scenes { command: Some(ScenesCommand::Check(args)) } => scenes::check(args),
        Command::Doctor(args) => doctor::run(&args),
        Command::Completions { shell } => manual::completions(Cli::known(), shell).map(done),
        Command::Man { dir } => manual::man(Cli::known(), &dir).map(done),
    }
}

fn done((): ()) -> ExitCode {
    ExitCode::SUCCESS
}
