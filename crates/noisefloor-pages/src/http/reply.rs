//! What is answered: files of the pages, and, when a request is refused, JSON that says what, where, and what
//! to do.

use axum::extract::Path;
use axum::http::header::CONTENT_TYPE;
use axum::http::{StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router};
use serde::Serialize;

#[derive(Debug)]
pub struct Refusal {
    status: StatusCode,
    body: Body,
}

#[derive(Debug, Serialize)]
struct Body {
    what: String,
    r#where: String,
    what_to_do: String,
    /// Number that the next event of the session has to have, where that is what was wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    next_seq: Option<u64>,
}

impl Refusal {
    /// A refusal: what is wrong, where in the request, and what to do instead.
    pub fn new(
        status: StatusCode,
        what: impl Into<String>,
        place: impl Into<String>,
        what_to_do: impl Into<String>,
    ) -> Self {
        let (what, place, what_to_do) = (what.into(), place.into(), what_to_do.into());
        Self { status, body: Body { what, r#where: place, what_to_do, next_seq: None } }
    }

    /// The same, and the number that the next event of the session has to have.
    #[must_use]
    pub fn with_next_seq(mut self, next: u64) -> Self {
        self.body.next_seq = Some(next);
        self
    }

    /// Whether it is that of [`Self::unknown_code`].
    pub fn is_unknown_code(&self) -> bool {
        self.status == StatusCode::NOT_FOUND && self.body.r#where == "code"
    }

    /// No session has the code of the request.
    pub fn unknown_code() -> Self {
        let do_ = "check the code, or begin a new session";
        Self::new(StatusCode::NOT_FOUND, "no session has this code", "code", do_)
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        (self.status, Json(self.body)).into_response()
    }
}

pub const HTML: &str = "text/html; charset=utf-8";
pub const SCRIPT: &str = "text/javascript; charset=utf-8";
pub const STYLE: &str = "text/css; charset=utf-8";

/// Name, type and text of a file.
pub type PageFile = (&'static str, &'static str, &'static str);

/// Questions and their answers by mouse and keys.
pub const ASK: PageFile = ("ask.js", SCRIPT, include_str!("../../pages/ask.js"));
/// Pictures, one image pixel to one device pixel.
pub const PICTURE: PageFile = ("picture.js", SCRIPT, include_str!("../../pages/picture.js"));
/// The sheet of conditions at the display.
pub const SHEET: PageFile = ("sheet.js", SCRIPT, include_str!("../../pages/sheet.js"));
/// The look that all pages share.
pub const LOOK: PageFile = ("style.css", STYLE, include_str!("../../pages/style.css"));
/// How the display is measured.
pub const VIEWING: PageFile = ("viewing.js", SCRIPT, include_str!("../../pages/viewing.js"));

/// Routes to a page at `base`, and to its files.
pub fn pages<S>(base: &str, page: &'static str, files: &'static [PageFile]) -> Router<S>
where
    S: Clone + Send + Sync + 'static,
{
    let file = async |name: Option<Path<String>>| {
        let name = name.map(|Path(name)| name).unwrap_or_default();
        match files.iter().find(|(known, ..)| *known == name) {
            Some((_, kind, text)) => ([(CONTENT_TYPE, *kind)], *text).into_response(),
            None => absent("there is no such page").into_response(),
        }
    };
    Router::new()
        .route(&format!("{base}/"), get(async move || ([(CONTENT_TYPE, HTML)], page)))
        .route(&format!("{base}/{{file}}"), get(file))
}

/// There is nothing at that path.
pub fn absent(what: &str) -> Refusal {
    Refusal::new(StatusCode::NOT_FOUND, what, "path", "go to /")
}

pub(super) async fn nothing_here(uri: Uri) -> Refusal {
    let path: String = uri.path().chars().take(100).collect();
    Refusal::new(StatusCode::NOT_FOUND, format!("nothing is at {path}"), "path", "go to /")
}

/// The route has no such method.
pub(super) async fn wrong_method() -> Refusal {
    let do_ = "GET reads, POST adds, DELETE erases a session";
    Refusal::new(StatusCode::METHOD_NOT_ALLOWED, "this is not done with that method", "method", do_)
}
