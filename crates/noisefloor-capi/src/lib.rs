//! noisefloor for C and C++: the oracle and its push session behind opaque handles.
//!
//! This crate has no Rust interface. cbindgen makes `include/noisefloor.h` from it, which says all there is
//! to say: errors, threads, pointers. The functions are declared here as C sees them:
//!
//! - `status.rs`: error codes, their messages, and the guard that no panic passes;
//! - `border.rs`: pointers from C become references and slices, checked as far as that is possible;
//! - `handle.rs`: handles, which are never followed;
//! - `params.rs`, `tone.rs`, `eyes.rs`, `oracle.rs`, `session.rs`, `push.rs`, `background.rs`, `results.rs`,
//!   `files.rs`, `check.rs`, `denoise.rs`, `tune.rs`: the functions;
//! - `wasm.rs`: what JavaScript needs beside them.
#![allow(unsafe_code, reason = "pointers come from C; nothing else here is unsafe")]
#![allow(unreachable_pub, reason = "C reaches what Rust does not, and cbindgen takes only what is public")]
#![allow(clippy::missing_safety_doc, reason = "one rule for all functions stands at the top of the header")]

mod background;
mod border;
mod check;
mod denoise;
mod eyes;
mod files;
mod handle;
mod oracle;
mod params;
mod push;
mod results;
mod session;
mod status;
mod tone;
mod tune;
#[cfg(target_family = "wasm")]
mod wasm;

#[cfg(test)]
mod header;
#[cfg(test)]
mod tests;
