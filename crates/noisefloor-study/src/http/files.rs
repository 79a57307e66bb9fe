//! Files of the pages, embedded in the program.

use super::reply::Refusal;
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};

pub(crate) const HTML: &str = "text/html; charset=utf-8";
pub(crate) const SCRIPT: &str = "text/javascript; charset=utf-8";
pub(crate) const STYLE: &str = "text/css; charset=utf-8";

/// Name, type and text of a file.
pub(crate) type PageFile = (&'static str, &'static str, &'static str);

/// The file of a name.
pub(crate) fn page_file(files: &[PageFile], name: &str) -> Response {
    match files.iter().find(|(known, ..)| *known == name) {
        Some((_, kind, text)) => ([(CONTENT_TYPE, *kind)], *text).into_response(),
        None => absent("there is no such page").into_response(),
    }
}

/// There is nothing at that path.
pub(crate) fn absent(what: &str) -> Refusal {
    Refusal::new(StatusCode::NOT_FOUND, what, "path", "go to /")
}
