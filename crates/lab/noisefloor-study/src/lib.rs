//! Experiments with people, in the browser: noise thresholds are collected, validated and analysed.
//!
//! This crate serves the commands: any release may change its interface.
//!
//! - [`Study`] is a checked study file: stacks of pictures, a protocol, what observers read and agree to.
//! - [`StudyServer`] shows it to observers and keeps every [`StudyEvent`] before it acknowledges it;
//!   [`store`] is where.
//! - [`ParticipantSession`] is the state that events move on; replaying them rebuilds it, which is how it
//!   is resumed and analysed.
//! - [`analysis`] makes thresholds, agreements and tables of the answers, and a corpus for `noisefloor
//!   train`.
//! - [`explore`] judges one's own pictures in the browser, keeps disagreements, and learns from them.
//! - [`simulated`] are observers made of numbers, who drive the same server: to test the whole chain, and
//!   to plan a study.
//!
//! ```
//! use noisefloor_image::write_png;
//! use noisefloor_study::{StudyEvent, ParticipantSession, Plan, Stage, Study, grids};
//! use std::sync::Arc;
//!
//! // Three pictures, named by their samples per pixel, and a study file beside them.
//! let folder = tempfile::tempdir()?;
//! std::fs::create_dir(folder.path().join("wall"))?;
//! for spp in [10, 100, 1000] {
//!     write_png(folder.path().join(format!("wall/{spp:05}.png")), 32, 16, &vec![128; 3 * 32 * 16])?;
//! }
//! let file = folder.path().join("study.toml");
//! std::fs::write(&file, r#"
//!     protocol = "acquisition"
//!     database = "answers.sqlite"
//!     tile = 16
//!     [text.en]
//!     title = "A grey wall"
//!     consent = "I take part."
//!     [[stack]]
//!     name = "wall"
//!     folder = "wall"
//! "#)?;
//!
//! let study = Arc::new(Study::open(&file)?);
//! let mut session = ParticipantSession::new(study.clone(), grids(&study), Plan::draw(&study, 1));
//! session.apply(&StudyEvent::Consent { language: "en".into() })?;
//! // Two tiles, and the practice and catch trials that a study has unless its file says otherwise.
//! assert_eq!((session.stage(), session.progress()), (Stage::Conditions, (0, 6)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![allow(missing_docs, reason = "serves the commands: any release may change what is public here")]

pub mod analysis;
mod code;
mod config;
mod error;
mod event;
pub mod explore;
mod server;
mod session;
pub mod simulated;
mod stack;
mod stack_render;
pub mod store;

pub use code::parse as parse_code;
pub use config::{
    AnswerOption, Participants, Question, QuestionKind, Screening, Study, StudyProtocol, Texts,
};
pub use error::{FileFault, StoreError, StudyError};
pub use event::{Choice, Envelope, LoopFrames, StudyEvent, TrialTiming};
pub use server::{
    Beginning, CompletionView, LanguageView, Overview, OverviewRow, SessionView, StackView, StudyServer,
    StudyView,
};
pub use session::{
    CatchKind, Class, EventMisfit, Haste, ParticipantSession, Plan, Stage, Trial, TrialOutcome, TrialRole,
    grids, replay,
};
pub use stack::StudyStack;
pub use stack_render::render_stack;
pub use store::{AnswerStore, NewSession, SessionRecord};
