//! Replies to requests that no route takes.

use super::reply::Refusal;
use axum::http::{StatusCode, Uri};

/// No route has this path.
pub(crate) async fn nothing_here(uri: Uri) -> Refusal {
    let path: String = uri.path().chars().take(100).collect();
    Refusal::new(StatusCode::NOT_FOUND, format!("nothing is at {path}"), "path", "go to /")
}

/// The route has no such method.
pub(crate) async fn wrong_method() -> Refusal {
    let do_ = "GET reads, POST adds, DELETE erases a session";
    Refusal::new(StatusCode::METHOD_NOT_ALLOWED, "this is not done with that method", "method", do_)
}
