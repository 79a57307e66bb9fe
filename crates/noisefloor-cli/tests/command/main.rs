//! Tests of the two commands as they are run: exit codes, files, and one line an error. One module a
//! subject; they need `--all-features`.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test fails by a panic, and may print")]

mod audience; // lines from one public to another
mod audit; // whether renders keep what they promise
mod bad_input; // one line, no panic, nothing lost
mod calibrate; // one's own eyes
mod compare; // criteria side by side
mod crash; // kills, full disks, folders that nobody can write
mod denoise; // renders that are judged denoised
#[cfg(target_os = "linux")]
mod farm; // many processes, kills, rubbish
mod folders; // output folders that are taken, and scenes that were edited
mod frames; // sequences, resumed and shared
mod help; // every subcommand explains itself
mod judge; // verdicts on pictures
mod kit; // running the command
mod learn; // train, inspect, evaluate
mod metrics; // published metrics of two pictures
mod reference; // the quick reference alone
mod render; // what is written, and that it is the same again
mod reproduce; // the paper's protocols: run, resumed, refused
#[cfg(target_os = "linux")]
mod say; // where results cannot go, and where nobody reads them
mod signals; // Ctrl-C, and worse
#[cfg(target_os = "linux")]
mod slurm; // a real Slurm
mod sources; // other renderers than our own
mod study; // stacks, links, raw data and copies of a study
mod tone; // what the screen shows: LUTs
mod tune; // a renderer's own setting
mod watch; // renders that are watched
