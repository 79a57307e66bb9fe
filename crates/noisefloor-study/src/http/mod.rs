//! What both servers share: connections within limits, checks of every request, and how refusals are worded.

mod body;
mod exposure;
mod fallback;
mod files;
mod guard;
mod listen;
mod patience;
mod reply;

pub(crate) use body::{read_bytes, read_json};
pub use exposure::Exposure;
pub(crate) use fallback::{nothing_here, wrong_method};
pub(crate) use files::{HTML, PageFile, SCRIPT, STYLE, absent, page_file};
pub(crate) use guard::{Client, Guard, check, security_headers};
pub(crate) use listen::Listening;
pub use listen::interrupted;
pub(crate) use reply::Refusal;
