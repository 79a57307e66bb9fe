//! Renderers in processes of their own, as sources of samples.
//!
//! - [`Renderer`]: what an adapter crate declares: a host script, pinned packages, supported Pythons.
//! - [`install`], [`find`], [`probe`]: a private environment in the user's cache folder, in one step.
//! - [`Sidecar`]: a running renderer as a [`noisefloor::ProgressiveSource`], with time limits, one restart
//!   per failure, and errors that carry its last words.
//! - [`CommandSource`]: any program that renders into a file, run once per batch.
//! - [`PictureCommand`]: any program that turns a picture into another, such as a denoiser.
//! - [`PictureFilter`]: the same in a process that stays, described by a [`Renderer`] too.
//! - `host/host.py` ([`HOST`]): the other end, which host scripts import.
//!
//! Nothing here accumulates or judges, and nothing knows a renderer by name.
//!
//! ```no_run
//! use noisefloor_sidecar::{HostOptions, Job, Renderer, Sidecar, find};
//!
//! const MINE: Renderer = Renderer {
//!     name: "mine",
//!     title: "My Renderer 1.0",
//!     script: "…",
//!     requirements: "mine==1.0 --hash=sha256:…",
//!     pythons: &[12, 11],
//!     probe: "import mine; print(mine.__version__)",
//! };
//! let python = find(&MINE)?;
//! let source = Sidecar::open(&MINE, &python, &Job::new("hall.mine"), HostOptions::default())?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The wire
//! The process is `python -I -u NAME_host.py`. A frame is two little-endian u32, the lengths of header and
//! payload; then the header, a JSON object of at most 1 MiB; then the payload, little-endian f32 RGB, top row
//! first. Only `filter` has a payload in its request. There is one reply to each, in order; `{"ok": false, "error": …, "tile":
//! …}` if the renderer refuses.
//!
//! | request | reply |
//! |---|---|
//! | `init` | `name`, `width`, `height`, `unit`, `repeats`, `late` and `stratified` (optional), `warnings` |
//! | `sample` | `samples`; payload: the means of the new samples of each tile that has any |
//! | `first_hits` | `first_hits` (true or false); payload: albedo and normals of the whole image if true |
//! | `adaptive` | `adaptive` (true or false), `counts` (optional); payload: the image, or its part, if true; with `counts` also the samples of each pixel, as another image |
//! | `filter` | payload: one picture |
//! | `quit` | the process ends after its reply |
//!
//! `init` has `protocol` (1), `scene`, `seed`, `width`, `height`, `max_depth`, `frame` (of a scene that holds
//! several), `threads`, `device` (both may be null) and `options`. A host whose samples depend on what computes
//! says it in `name`, by which sessions are resumed.
//! `sample` has `tiles`, each with `index`, `x`, `y`, `width`, `height`, `first` and `samples`;
//! the reply's `samples` has a count for each: at most as many as requested, unless `late` in the reply to
//! `init` says how many samples, over all pixels of a tile, the renderer takes before it can stop.
//!
//! `first_hits` has `index` and `samples`. `adaptive` has `threshold`, `samples` (the most per pixel, or null for
//! what the scene says) and `seed`: the renderer samples as it likes, until its own noise threshold. `counts` are the fewest samples
//! of a pixel, those with a threshold finer by √2, and the most.
//!
//! A host that filters pictures gets `init` with `protocol`, `threads` and `device` only, and replies with its `name`, and
//! `warnings` (optional). `filter`
//! has `width`, `height` and `pictures`, the names of the pictures in the payload.
//!
//! # What is left behind
//! Nothing. A renderer leads a process group of its own, and the whole group is killed with it. It ends when
//! its standard input does; on Linux also with the thread that started it, so that even killing the parent
//! leaves nothing running. A program that calls [`std::process::exit`] calls [`end_all`] first.

mod call;
mod command;
mod contents;
mod error;
mod frame;
mod fuzzing;
mod group;
mod launch;
mod leftovers;
mod message;
mod picture_command;
mod picture_filter;
mod picture_run;
mod process;
mod renderer;
mod run;
mod scratch;
mod setup;
mod sidecar;
mod template;
mod threshold_command;

pub use command::{CommandOptions, CommandSource};
pub use error::{CommandError, RunFault, SetupError, SidecarCause, SidecarError};
#[doc(hidden)]
pub use fuzzing::read_any_reply;
pub use leftovers::end_all;
pub use picture_command::PictureCommand;
pub use picture_filter::{FilterPlan, PictureFilter};
pub use renderer::{DEFAULT_TIMEOUT, Device, HostOptions, Job, Renderer};
pub use setup::{HOST, find, gpus, install, private_folder, probe};
pub use sidecar::{AdaptivePicture, Sidecar};
pub use threshold_command::ThresholdCommand;
