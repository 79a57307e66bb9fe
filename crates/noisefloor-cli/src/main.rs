//! The `noisefloor` command. What can be typed is in [`args`]; each other module runs one command.
#![allow(missing_docs, unreachable_pub, reason = "a command has no public items")]
#![allow(clippy::print_stdout, reason = "a command prints")]

mod args;
mod audience;
mod bars;
mod compare;
mod doctor;
mod evaluate;
mod explore;
mod inspect;
mod judge;
mod output;
mod reference;
mod render;
mod reproduce;
mod sources;
mod study;
mod train;

use args::{Cli, Command};
use clap::Parser;
use std::process::ExitCode;

/// Ended by Ctrl-C or SIGTERM, with everything written: 128 + SIGINT.
const INTERRUPTED: u8 = 130;

/// Whoever reads our output may have had enough (`noisefloor scenes | head -1`): that ends the command, and is no fault of its own.
/// `println!` panics then; the signal that would end it before is ignored, since it also comes when a renderer we talk to dies.
fn end_quietly_when_nobody_reads() {
    let otherwise = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let broken =
            |message: &str| message.starts_with("failed printing to std") && message.contains("Broken pipe");
        if panic.payload().downcast_ref::<String>().is_some_and(|message| broken(message)) {
            std::process::exit(0);
        }
        otherwise(panic);
    }));
}

fn main() -> ExitCode {
    end_quietly_when_nobody_reads();
    let outcome = match Cli::parse().command {
        Command::Render(args) => render::run(&args),
        Command::Reference(args) => reference::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Judge(args) => judge::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Train(args) => train::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Evaluate(args) => evaluate::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Explore(args) => explore::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Audience(args) => audience::run(&args.command).map(|()| ExitCode::SUCCESS),
        Command::Reproduce(args) => reproduce::run(&args),
        Command::Study(args) => study::run(&args.command).map(|()| ExitCode::SUCCESS),
        Command::Inspect(args) => inspect::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Doctor(args) => doctor::run(&args),
        Command::Scenes => {
            inspect::scenes();
            Ok(ExitCode::SUCCESS)
        }
    };
    outcome.unwrap_or_else(|error| {
        eprintln!("error: {}", one_line(&error));
        ExitCode::FAILURE
    })
}

/// An error and its causes in one line; a cause that its parent already quotes is not said twice.
fn one_line(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if !line.contains(&cause) {
            if !line.is_empty() {
                line.push_str(": ");
            }
            line.push_str(&cause);
        }
    }
    line.replace('\n', " ")
}
