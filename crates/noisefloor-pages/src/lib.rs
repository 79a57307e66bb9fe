//! What noisefloor shows in the browser without a database: `noisefloor-study` builds on it.
//!
//! This crate serves the commands: any release may change its interface.
//!
//! - [`http`] is the server of all pages: connections within limits, checks of every request, refusals.
//! - [`watch`] shows a render while it runs.
//! - [`calibrate`] measures how many samples one's own eyes need, in two minutes.
//! - [`viewing`], [`languages`], [`questplus`] and [`random`] are what a calibration shares with a study: the
//!   conditions at a display, the texts of the pages, the choice of the next trial, and seeds.
//!
//! ```no_run
//! use noisefloor_pages::http::Exposure;
//! use noisefloor_pages::watch::{LiveRender, LiveState, WatchServer};
//! use std::sync::Arc;
//!
//! let live = Arc::new(LiveRender::default());
//! let address = WatchServer::start(live.clone(), ([127, 0, 0, 1], 8437).into(), &Exposure::default())?;
//! println!("http://{address}/");
//! live.publish(&LiveState::new("cornell-box", "ptwne"), None);
//! # Ok::<(), noisefloor_pages::PagesError>(())
//! ```

#![allow(missing_docs, reason = "serves the commands: any release may change what is public here")]

pub mod calibrate;
mod error;
pub mod http;
pub mod languages;
pub mod questplus;
pub mod random;
pub mod viewing;
pub mod watch;

pub use error::PagesError;
