//! Requests of the pages. Replies are JSON, except tiles, which are PNG files.

use super::app::App;
use super::views::{Beginning, SessionView, StackView, StudyView};
use crate::code;
use crate::error::StoreError;
use crate::event::Envelope;
use crate::http::{Refusal, read_json};
use crate::stack::StudyStack;
use axum::Json;
use axum::body::Body;
use axum::extract::rejection::PathRejection;
use axum::extract::{ConnectInfo, Path, State};
use axum::http::StatusCode;
use axum::http::header::{CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use std::net::SocketAddr;
use std::sync::Arc;

type Answer = Result<Response, Refusal>;
type Shared = State<Arc<App>>;
type Peer = ConnectInfo<SocketAddr>;

/// `GET /api/study`
pub(crate) async fn study(State(app): Shared) -> Response {
    let stack = |s: &StudyStack| StackView {
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

/// `POST /api/sessions`
pub(crate) async fn begin(State(app): Shared, body: Body) -> Answer {
    let Beginning { group, simulated } = read_json(body).await?;
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
    let envelope: Envelope = read_json(body).await?;
    if !envelope.has_sane_clock() {
        let do_ = "send milliseconds since 1970";
        return Err(Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, "the clock is out of range", "at", do_));
    }
    // Runs to its end even if who asked is gone: memory and disk stay the same
    let (worker, of) = (app.clone(), code.clone());
    let work = tokio::spawn(async move { worker.record(&of, envelope).await });
    let done = work.await.map_err(|_| Refusal::from(StoreError::Closed))?;
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
