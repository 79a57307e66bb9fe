//! The pages, embedded in the program.

use crate::http::Refusal;
use axum::extract::Path;
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};

macro_rules! page {
    ($name:literal, $kind:literal) => {
        ($name, $kind, include_str!(concat!("../../pages/", $name)))
    };
}

const HTML: &str = include_str!("../../pages/index.html");
/// Name, type and text of each file.
const FILES: [(&str, &str, &str); 12] = [
    page!("app.js", "text/javascript; charset=utf-8"),
    page!("ask.js", "text/javascript; charset=utf-8"),
    page!("experimenter.css", "text/css; charset=utf-8"),
    page!("experimenter.html", "text/html; charset=utf-8"),
    page!("experimenter.js", "text/javascript; charset=utf-8"),
    page!("picture.js", "text/javascript; charset=utf-8"),
    page!("server.js", "text/javascript; charset=utf-8"),
    page!("sheet.js", "text/javascript; charset=utf-8"),
    page!("trials.js", "text/javascript; charset=utf-8"),
    page!("viewing.js", "text/javascript; charset=utf-8"),
    page!("welcome.js", "text/javascript; charset=utf-8"),
    page!("style.css", "text/css; charset=utf-8"),
];

/// The page of the participants.
pub(crate) async fn page() -> Response {
    ([(CONTENT_TYPE, "text/html; charset=utf-8")], HTML).into_response()
}

/// A file of the pages.
pub(crate) async fn file(name: Option<Path<String>>) -> Response {
    let name = name.map(|Path(name)| name).unwrap_or_default();
    match FILES.iter().find(|(known, ..)| *known == name) {
        Some((_, kind, text)) => ([(CONTENT_TYPE, *kind)], *text).into_response(),
        None => {
            Refusal::new(StatusCode::NOT_FOUND, "there is no such page", "path", "go to /").into_response()
        }
    }
}
