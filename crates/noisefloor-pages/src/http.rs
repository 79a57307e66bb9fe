//! What all servers share: connections within limits, checks of every request, and how refusals are worded.

mod body;
mod exposure;
mod guard;
mod listen;
mod patience;
mod reply;

pub use body::{read_bytes, read_json};
pub use exposure::Exposure;
pub use guard::{Client, Guard};
pub use listen::{Listening, interrupted};
pub use reply::{ASK, HTML, LOOK, PICTURE, PageFile, Refusal, SCRIPT, SHEET, STYLE, VIEWING, absent, pages};
