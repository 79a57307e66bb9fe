//! Tests of the `noisefloor` command as it is run: exit codes, files, and one line an error. One module a subject.

/// Lines from one public to another.
#[cfg(test)]
mod audience;
/// One line, no panic, nothing lost.
#[cfg(test)]
mod bad_input;
/// Criteria side by side.
#[cfg(test)]
mod compare;
/// Every subcommand explains itself.
#[cfg(test)]
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
/// The quick reference alone.
#[cfg(test)]
mod reference;
/// What is written, and that it is the same again.
#[cfg(test)]
mod render;
/// The paper's protocols: run, resumed, refused.
#[cfg(test)]
mod reproduce;
/// Ctrl-C, and worse.
#[cfg(test)]
mod signals;
/// Other renderers than our own.
#[cfg(test)]
mod sources;
