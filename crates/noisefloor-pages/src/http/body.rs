//! Bodies of requests, within limits.

use super::reply::Refusal;
use axum::body::{Body, Bytes, to_bytes};
use axum::http::StatusCode;
use serde::de::DeserializeOwned;
use std::time::Duration;

/// Longest body, in bytes: an event has a few hundred.
const MAX_BODY: usize = 16 << 10;
/// Time for a body to come in.
const BODY_TIME: Duration = Duration::from_secs(10);

/// Reads a body of at most 16 kB as JSON.
pub async fn read_json<T: DeserializeOwned>(body: Body) -> Result<T, Refusal> {
    let bytes = read_bytes(body, MAX_BODY, BODY_TIME, "send one event at a time").await?;
    serde_json::from_slice(&bytes).map_err(|error| {
        let what = format!("not the JSON expected: {error}");
        Refusal::new(StatusCode::BAD_REQUEST, what, "body", "docs/studies.md lists what is sent")
    })
}

/// Reads a body of at most `most` bytes; `instead` is what to do if it is longer.
pub async fn read_bytes(body: Body, most: usize, time: Duration, instead: &str) -> Result<Bytes, Refusal> {
    let refuse = |status, what: String, do_: &str| Err(Refusal::new(status, what, "body", do_));
    match tokio::time::timeout(time, to_bytes(body, most)).await {
        Err(_) => refuse(StatusCode::REQUEST_TIMEOUT, "the body did not come".into(), "send it at once"),
        Ok(Err(_)) => {
            let what = format!("the body is cut short, or longer than {most} bytes");
            refuse(StatusCode::PAYLOAD_TOO_LARGE, what, instead)
        }
        Ok(Ok(bytes)) => Ok(bytes),
    }
}
