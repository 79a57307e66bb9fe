//! The study file: as written ([`file`]), its rules ([`rules`]), and the checked study ([`study`]).

mod file;
mod rules;
mod study;

pub use rules::{AnswerOption, Participants, Question, QuestionKind, Screening, StudyProtocol, Texts};
pub use study::Study;
