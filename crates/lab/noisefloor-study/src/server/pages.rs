//! The pages, embedded in the program.

use axum::extract::Path;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use noisefloor_pages::http::{ASK, HTML, LOOK, PICTURE, PageFile, SCRIPT, SHEET, STYLE, VIEWING, page_file};

macro_rules! page {
    ($name:literal, $kind:expr) => {
        ($name, $kind, include_str!(concat!("../../pages/", $name)))
    };
}

const PAGE: &str = include_str!("../../pages/index.html");
const FILES: [PageFile; 12] = [
    page!("app.js", SCRIPT),
    ASK,
    page!("experimenter.css", STYLE),
    page!("experimenter.html", HTML),
    page!("experimenter.js", SCRIPT),
    PICTURE,
    page!("server.js", SCRIPT),
    SHEET,
    page!("trials.js", SCRIPT),
    VIEWING,
    page!("welcome.js", SCRIPT),
    LOOK,
];

pub(crate) async fn page() -> Response {
    ([(CONTENT_TYPE, HTML)], PAGE).into_response()
}

pub(crate) async fn file(name: Option<Path<String>>) -> Response {
    let name = name.map(|Path(name)| name).unwrap_or_default();
    page_file(&FILES, &name)
}
