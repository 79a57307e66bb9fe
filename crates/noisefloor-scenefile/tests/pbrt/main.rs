//! Tests of pbrt scenes, one module a subject.

/// What is broken or not supported, and where.
#[cfg(test)]
mod bad;
/// What is taken where a parameter is not given.
#[cfg(test)]
mod defaults;
/// Damaged files are errors or scenes, never a panic.
#[cfg(test)]
mod hostile;
/// What scenes look like.
#[cfg(test)]
mod looks;
/// Scenes to write, load and look at.
#[cfg(test)]
mod util;
