//! Tests that cross crates, one module a subject.

/// The table that ships, the model made of it, and how close it is to people.
#[cfg(test)]
mod accuracy;
/// What every source promises, and that broken promises are noticed.
#[cfg(test)]
mod contract;
/// A descriptor of one's own, by the recipe.
#[cfg(test)]
mod descriptor;
/// Driver, oracle and renderer together.
#[cfg(test)]
mod end_to_end;
/// Halves are equals.
#[cfg(test)]
mod halves;
/// Sources made by hand.
#[cfg(test)]
mod kit;
/// Mitsuba, where it is installed.
#[cfg(test)]
mod mitsuba;
/// The oldest Rust that is promised.
#[cfg(test)]
mod msrv;
/// Judging alone needs no machinery of training.
#[cfg(test)]
mod no_linfa;
/// Extreme radiance, odd sizes, uneven halves.
#[cfg(test)]
mod numerics;
/// Contracts of the core, by its public interface alone.
#[cfg(test)]
mod outside;
/// What people said of real renders.
#[cfg(test)]
mod people;
/// Where two features meet.
#[cfg(test)]
mod regressions;
/// LuxCore and Cycles, where they are installed.
#[cfg(test)]
mod renderers;
/// Sessions say nothing of right samples.
#[cfg(test)]
mod watch;
