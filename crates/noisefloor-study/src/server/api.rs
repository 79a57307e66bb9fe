//! What the pages ask and tell. Every answer is JSON, but for tiles, which are PNG files.

use super::App;
use super::reply::Refusal;
use crate::code;
use crate::config::{Protocol, Texts};
use crate::event::Envelope;
use crate::session::{Session, Stage, Trial};
use axum::Json;
use axum::body::{Body, Bytes, to_bytes};
use axum::extract::rejection::PathRejection;
use axum::extract::{ConnectInfo, Path, State};
use axum::http::header::{CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::http::{StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

/// Longest body, in bytes: an event has a few hundred.
const MAX_BODY: usize = 16 << 10;
/// Time for a body to come in.
const BODY_TIME: Duration = Duration::from_secs(10);

/// What a page has to know of a study.
#[derive(Debug, Serialize, Deserialize)]
pub struct StudyView {
    /// What observers do.
    pub protocol: Protocol,
    /// Groups that observers choose from.
    pub groups: Vec<String>,
    /// By language.
    pub text: BTreeMap<String, Texts>,
    /// Forced choice: time of an interval in milliseconds.
    pub interval_ms: u32,
    /// Shapes of the pictures.
    pub stacks: Vec<StackView>,
}

/// The shape of a stack.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StackView {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Edge of the tiles in pixels.
    pub tile: usize,
    /// Samples per pixel of each level.
    pub levels: Vec<u64>,
}

/// Where a session is.
#[derive(Debug, Serialize, Deserialize)]
pub struct SessionView {
    /// The participant's code.
    pub code: String,
    /// Number of the next event.
    pub next_seq: u64,
    /// How far the observer has come.
    pub stage: Stage,
    /// Whether the observer has paused.
    pub paused: bool,
    /// Trials answered.
    pub done: u32,
    /// Trials in all.
    pub total: u32,
    /// Language of the consent.
    pub language: Option<String>,
    /// What is to be shown.
    pub trial: Option<Trial>,
}

impl SessionView {
    fn of(code: &str, session: &Session) -> Self {
        let (done, total) = session.progress();
        Self {
            code: code.to_owned(),
            next_seq: session.events(),
            stage: session.stage(),
            paused: session.is_paused(),
            done,
            total,
            language: session.language().map(str::to_owned),
            trial: session.trial(),
        }
    }
}

type Answer = Result<Response, Refusal>;
type Shared = State<Arc<App>>;
type Peer = ConnectInfo<SocketAddr>;

/// `GET /api/study`
pub(crate) async fn study(State(app): Shared) -> Response {
    let stack = |s: &crate::stack::Stack| StackView {
        width: s.grid().width(),
        height: s.grid().height(),
        tile: s.grid().edge(),
        levels: s.levels().to_vec(),
    };
    let study = &app.study;
    Json(StudyView {
        protocol: study.protocol,
        groups: study.groups.clone(),
        text: study.text.clone(),
        interval_ms: study.interval_ms,
        stacks: study.stacks.iter().map(stack).collect(),
    })
    .into_response()
}

/// What begins a session.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beginning {
    /// One of the study's groups; empty if it has none.
    pub group: String,
    /// Whether this is a simulated observer, whose answers are kept apart.
    #[serde(default)]
    pub simulated: bool,
}

/// `POST /api/sessions`
pub(crate) async fn begin(State(app): Shared, body: Body) -> Answer {
    let Beginning { group, simulated } = read(body).await?;
    let known =
        if app.study.groups.is_empty() { group.is_empty() } else { app.study.groups.contains(&group) };
    if !known {
        let do_ = format!("choose one of {:?}", app.study.groups);
        return Err(Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, "no such group", "group", do_));
    }
    let (code, seed) = (code::draw()?, code::draw_seed()?);
    app.store.begin(&code, seed, &group, simulated).await?;
    let view = app.with(&code, |session| SessionView::of(&code, session)).await?;
    Ok((StatusCode::CREATED, Json(view)).into_response())
}

/// `GET /api/sessions/{code}`
pub(crate) async fn view(
    State(app): Shared,
    ConnectInfo(peer): Peer,
    typed: Result<Path<String>, PathRejection>,
) -> Answer {
    let code = known_code(&app, peer, typed)?;
    let view = app.with(&code, |session| SessionView::of(&code, session)).await;
    Ok(Json(counted(&app, peer, view)?).into_response())
}

/// `POST /api/sessions/{code}/events`
pub(crate) async fn event(
    State(app): Shared,
    ConnectInfo(peer): Peer,
    typed: Result<Path<String>, PathRejection>,
    body: Body,
) -> Answer {
    let code = known_code(&app, peer, typed)?;
    let envelope: Envelope = read(body).await?;
    if !envelope.has_sane_clock() {
        let do_ = "send milliseconds since 1970";
        return Err(Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, "the clock is out of range", "at", do_));
    }
    // Runs to its end even if who asked is gone: memory and disk stay the same
    let (worker, of) = (app.clone(), code.clone());
    let work = tokio::spawn(async move { worker.record(&of, envelope).await });
    let done = work.await.map_err(|_| Refusal::from(crate::error::StoreError::Closed))?;
    let session = counted(&app, peer, done)?;
    Ok(Json(SessionView::of(&code, &session)).into_response())
}

/// `GET /api/sessions/{code}/export`
pub(crate) async fn export(
    State(app): Shared,
    ConnectInfo(peer): Peer,
    typed: Result<Path<String>, PathRejection>,
) -> Answer {
    let code = known_code(&app, peer, typed)?;
    let record = counted(&app, peer, app.store.load(&code).await.map_err(Refusal::from))?;
    let name = format!("attachment; filename=\"noisefloor-{code}.json\"");
    Ok(([(CONTENT_DISPOSITION, name)], Json(record)).into_response())
}

/// `DELETE /api/sessions/{code}`
pub(crate) async fn erase(
    State(app): Shared,
    ConnectInfo(peer): Peer,
    typed: Result<Path<String>, PathRejection>,
) -> Answer {
    let code = known_code(&app, peer, typed)?;
    let place = app.place(&code);
    let mut live = place.lock().await;
    let erased = app.store.erase(&code).await.map_err(Refusal::from);
    *live = None;
    app.forget(&code);
    counted(&app, peer, erased)?;
    Ok(StatusCode::NO_CONTENT.into_response())
}

/// `GET /api/tiles/{stack}/{level}/{tile}`, where the tile ends in `.png`
pub(crate) async fn tile(
    State(app): Shared,
    place: Result<Path<(String, String, String)>, PathRejection>,
) -> Answer {
    let no_tile =
        || Refusal::new(StatusCode::NOT_FOUND, "there is no such tile", "path", "ask for what a trial names");
    let Path((stack, level, tile)) = place.map_err(|_| no_tile())?;
    let number = |text: &str| text.parse::<u32>().map_err(|_| no_tile());
    let (stack, level) = (number(&stack)?, number(&level)?);
    let tile = number(tile.strip_suffix(".png").ok_or_else(no_tile)?)?;
    let shape = app.study.stacks.get(stack as usize).ok_or_else(no_tile)?;
    if level > shape.last() || tile as usize >= shape.grid().len() {
        return Err(no_tile());
    }
    let tiles = app.tiles.level((stack, level)).await.map_err(|error| {
        eprintln!("error: {error}");
        let do_ = "tell who runs the study: a picture cannot be read";
        Refusal::new(StatusCode::INTERNAL_SERVER_ERROR, "the picture cannot be shown", "pictures", do_)
    })?;
    let png = tiles.get(tile as usize).ok_or_else(no_tile)?.clone();
    // The design of a study does not change under its address, but another study may come to it
    Ok(([(CONTENT_TYPE, "image/png"), (CACHE_CONTROL, "private, max-age=3600")], png).into_response())
}

/// What no route answers.
pub(crate) async fn nothing_here(uri: Uri) -> Refusal {
    let path: String = uri.path().chars().take(100).collect();
    Refusal::new(StatusCode::NOT_FOUND, format!("nothing is at {path}"), "path", "go to /")
}

/// A route that does not answer this method.
pub(crate) async fn wrong_method() -> Refusal {
    let do_ = "GET reads, POST adds, DELETE erases a session";
    Refusal::new(StatusCode::METHOD_NOT_ALLOWED, "this is not done with that method", "method", do_)
}

fn known_code(
    app: &App,
    peer: SocketAddr,
    typed: Result<Path<String>, PathRejection>,
) -> Result<String, Refusal> {
    let code = typed.ok().and_then(|Path(typed)| code::parse(&typed));
    counted(app, peer, code.ok_or_else(Refusal::unknown_code))
}

/// Counts wrong codes of an address.
fn counted<T>(app: &App, peer: SocketAddr, result: Result<T, Refusal>) -> Result<T, Refusal> {
    if result.as_ref().is_err_and(Refusal::is_unknown_code) {
        app.guard.count(peer.ip());
    }
    result
}

/// Reads a body of bearable length as JSON.
pub(crate) async fn read<T: DeserializeOwned>(body: Body) -> Result<T, Refusal> {
    let bytes = read_bytes(body, MAX_BODY, BODY_TIME, "send one event at a time").await?;
    serde_json::from_slice(&bytes).map_err(|error| {
        let what = format!("not the JSON expected: {error}");
        Refusal::new(StatusCode::BAD_REQUEST, what, "body", "docs/study.md lists what is sent")
    })
}

/// Reads a body of at most `most` bytes; `instead` is what to do if it is longer.
pub(crate) async fn read_bytes(
    body: Body,
    most: usize,
    time: Duration,
    instead: &str,
) -> Result<Bytes, Refusal> {
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
