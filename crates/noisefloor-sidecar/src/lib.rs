//! Renderers in processes of their own, as sources of samples.
//!
//! - [`Renderer`]: what an adapter crate says of its renderer: a host script, pinned packages, the Pythons it needs.
//! - [`install`], [`find`], [`probe`]: a private environment in the user's cache folder, in one step.
//! - [`Sidecar`]: a running renderer as a [`noisefloor::ProgressiveSource`], with time-outs, one restart for a failure, and
//!   errors that carry its last words.
//! - `host/host.py` ([`HOST`]): the other end, which host scripts import.
//!
//! Nothing here accumulates or judges, and nothing knows a renderer by name.
//!
//! ```no_run
//! use noisefloor_sidecar::{Adapter, Job, Renderer, Sidecar, find};
//!
//! const MINE: Renderer = Renderer {
//!     name: "mine",
//!     title: "My Renderer 1.0",
//!     script: "import os, sys\nsys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))\nimport host\n…",
//!     requirements: "mine==1.0 --hash=sha256:…",
//!     pythons: &[12, 11],
//!     probe: "import mine; print(mine.__version__)",
//! };
//! let python = find(&MINE)?;
//! let source = Sidecar::open(&MINE, &python, &Job::new("hall.mine"), Adapter::default())?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The wire
//! The process is `python -I -u NAME_host.py`. A frame is two little-endian u32, the lengths of header and payload, then the header,
//! a JSON object of at most 1 MiB, then the payload, little-endian f32 RGB, top row first. Requests have no payload; there is one
//! reply to each, in order, `{"ok": false, "error": …, "tile": …}` where the renderer cannot.
//!
//! | request | reply |
//! |---|---|
//! | `init`: `protocol` (1), `scene`, `seed`, `width`, `height`, `max_depth`, `threads` (or null), `options` | `name`, `width`, `height`, `unit`, `repeats`, `warnings` |
//! | `sample`: `tiles`, each `index`, `x`, `y`, `width`, `height`, `first`, `samples` | `samples`, a number a tile; payload: the means of the new samples of each tile with any |
//! | `reference` | `reference` (true or false); payload: the whole image if true |
//! | `quit` | and then the end |
//!
//! The process ends when its standard input does, and on Linux also with the thread that started it, so that nothing is left behind
//! even if the parent is killed.

mod command;
mod error;
mod frame;
mod process;
mod renderer;
mod run;
mod setup;
mod sidecar;

pub use command::{CommandOptions, CommandSource};
pub use error::{CommandError, SetupError, SidecarCause, SidecarError};
pub use renderer::{DEFAULT_TIMEOUT, Job, Renderer};
pub use setup::{HOST, find, install, private_folder, probe};
pub use sidecar::{Adapter, Sidecar};
