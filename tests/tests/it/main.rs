//! Tests that cross crates, one module a subject.
#![allow(clippy::unwrap_used, reason = "a panic in a test is how a test fails")]

mod accuracy; // the table that ships, the model made of it, and how close it is to people
mod bindings; // what Python and JavaScript replay
mod contract; // what every source promises, and that broken promises are noticed
mod descriptor; // a descriptor of one's own, by the recipe
mod end_to_end; // driver, oracle and renderer together
mod halves; // halves are equals
mod kit; // sources made by hand
mod mitsuba; // Mitsuba, where it is installed
mod msrv; // the oldest Rust that is promised
mod numerics; // extreme radiance, odd sizes, uneven halves
mod outside; // contracts of the core, by its public interface alone
mod people; // what people said of real renders
mod regressions; // where two features meet
mod renderers; // LuxCore and Cycles, where they are installed
mod watch; // sessions say nothing of right samples
