//! The page, embedded in the program.

use axum::Json;
use axum::extract::Path;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use noisefloor_pages::http::{ASK, LOOK, PageFile, Refusal, SCRIPT, STYLE};
use noisefloor_pages::languages::parse_language;

pub(super) const PAGE: &str = include_str!("../../pages/explore/index.html");
pub(super) const FILES: [PageFile; 10] = [
    ASK,
    ("explore.js", SCRIPT, include_str!("../../pages/explore/explore.js")),
    ("grid.js", SCRIPT, include_str!("../../pages/explore/grid.js")),
    ("learn.js", SCRIPT, include_str!("../../pages/explore/learn.js")),
    ("line.js", SCRIPT, include_str!("../../pages/explore/line.js")),
    ("parts.js", SCRIPT, include_str!("../../pages/explore/parts.js")),
    ("server.js", SCRIPT, include_str!("../../pages/explore/server.js")),
    ("viewer.js", SCRIPT, include_str!("../../pages/explore/viewer.js")),
    LOOK,
    ("explore.css", STYLE, include_str!("../../pages/explore/explore.css")),
];

const LANGUAGES: [(&str, &str); 2] = [
    ("en", include_str!("../../pages/explore/languages/en.toml")),
    ("fr", include_str!("../../pages/explore/languages/fr.toml")),
];

/// Texts of the page in one language.
pub(crate) async fn texts(Path(code): Path<String>) -> Response {
    let found = LANGUAGES.iter().find(|(known, _)| *known == code);
    match found.map(|(code, text)| parse_language(text, std::path::Path::new(code))) {
        Some(Ok(language)) => Json(language.text).into_response(),
        _ => {
            Refusal::new(StatusCode::NOT_FOUND, "the page is not in that language", "language", "ask for en")
                .into_response()
        }
    }
}
