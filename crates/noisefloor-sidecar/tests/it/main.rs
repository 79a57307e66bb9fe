//! A renderer written in Python over `host.py` that can be told to misbehave. They need Python.
#![allow(clippy::unwrap_used, reason = "a panic in a test is how a test fails")]

mod command;
mod devices;
mod failures;
mod filter;
mod kit;
mod life;
mod setup;
mod work;
