//! Tests of the two commands as they are run: exit codes, files, and one line an error. One module a
//! subject; they need `--all-features`.

/// Lines from one public to another.
#[cfg(test)]
mod audience;
/// Whether renders keep what they promise.
#[cfg(test)]
mod audit;
/// One line, no panic, nothing lost.
#[cfg(test)]
mod bad_input;
/// One's own eyes.
#[cfg(test)]
mod calibrate;
/// Criteria side by side.
#[cfg(test)]
mod compare;
/// Kills, full disks, folders that nobody can write.
#[cfg(test)]
mod crash;
/// Renders that are judged denoised.
#[cfg(test)]
mod denoise;
/// Many processes, kills, rubbish.
#[cfg(test)]
#[cfg(target_os = "linux")]
mod farm;
/// Output folders that are taken, and scenes that were edited.
#[cfg(test)]
mod folders;
/// Every subcommand explains itself.
#[cfg(test)]
mod frames;
mod help;
/// Verdicts on pictures.
#[cfg(test)]
mod judge;
/// Running the command.
#[cfg(test)]
mod kit;
/// Train, inspect, evaluate.
#[cfg(test)]
mod learn;
/// Published metrics of two pictures.
#[cfg(test)]
mod metrics;
/// The quick reference alone.
#[cfg(test)]
mod reference;
/// What is written, and that it is the same again.
#[cfg(test)]
mod render;
/// The paper's protocols: run, resumed, refused.
#[cfg(test)]
mod reproduce;
/// Where results cannot go, and where nobody reads them.
#[cfg(test)]
#[cfg(target_os = "linux")]
mod say;
/// Ctrl-C, and worse.
#[cfg(test)]
mod signals;
/// A real Slurm.
#[cfg(test)]
#[cfg(target_os = "linux")]
mod slurm;
/// Other renderers than our own.
#[cfg(test)]
mod sources;
/// Stacks, links, raw data and copies of a study.
#[cfg(test)]
mod study;
/// What the screen shows: LUTs.
#[cfg(test)]
mod tone;
/// A renderer's own setting.
#[cfg(test)]
mod tune;
/// Renders that are watched.
#[cfg(test)]
mod watch;
