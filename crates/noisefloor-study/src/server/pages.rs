//! The pages, embedded in the program.

use crate::http::{HTML, PageFile, SCRIPT, STYLE, page_file};
use axum::extract::Path;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};

macro_rules! page {
    ($name:literal, $kind:expr) => {
        ($name, $kind, include_str!(concat!("../../pages/", $name)))
    };
}

const PAGE: &str = include_str!("../../pages/index.html");
const FILES: [PageFile; 12] = [
    page!("app.js", SCRIPT),
    page!("ask.js", SCRIPT),
    page!("experimenter.css", STYLE),
    page!("experimenter.html", HTML),
    page!("experimenter.js", SCRIPT),
    page!("picture.js", SCRIPT),
    page!("server.js", SCRIPT),
    page!("sheet.js", SCRIPT),
    page!("trials.js", SCRIPT),
    page!("viewing.js", SCRIPT),
    page!("welcome.js", SCRIPT),
    page!("style.css", STYLE),
];

/// The page of the participants.
pub(crate) async fn page() -> Response {
    ([(CONTENT_TYPE, HTML)], PAGE).into_response()
}

/// A file of the pages.
pub(crate) async fn file(name: Option<Path<String>>) -> Response {
    let name = name.map(|Path(name)| name).unwrap_or_default();
    page_file(&FILES, &name)
}
