//! Requests of the pages. Replies are JSON, except tiles, which are PNG files.

use super::app::App;
use super::views::{Beginning, SessionView, StudyView};
use crate::code;
use crate::error::StoreError;
use crate::event::Envelope;
use crate::session::Plan;
use crate::store::NewSession;
use axum::Json;
use axum::body::Body;
use axum::extract::rejection::PathRejection;
use axum::extract::{Extension, Path, State};
use axum::http::StatusCode;
use axum::http::header::{CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use noisefloor_pages::http::{Client, Refusal, read_json};
use std::sync::Arc;
use std::sync::atomic::Ordering;

type Answer = Result<Response, Refusal>;
type Shared = State<Arc<App>>;
type Peer = Extension<Client>;
/// Longest identifier from an address, in bytes.
const MAX_ID: usize = 200;

/// `GET /api/study`
pub(crate) async fn study(State(app): Shared) -> Response {
    Json(StudyView::of(&app.study)).into_response()
}

/// `GET /api/texts/{language}`
pub(crate) async fn texts(State(app): Shared, code: Result<Path<String>, PathRejection>) -> Answer {
    let found = code.ok().and_then(|Path(code)| app.study.languages.get(&code).cloned());
    let do_ = "ask for a language of the study";
    let none = || Refusal::new(StatusCode::NOT_FOUND, "the study is not in that language", "language", do_);
    Ok(Json(found.ok_or_else(none)?.text).into_response())
}

/// `POST /api/sessions`
pub(crate) async fn begin(State(app): Shared, Extension(client): Peer, body: Body) -> Answer {
    let Beginning { group, simulated, link, ids } = read_json(body).await?;
    let refuse = |what: &str, place: &str, do_: String| {
        Err(Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, what, place, do_))
    };
    if simulated && !app.simulated.load(Ordering::Relaxed) {
        let do_ = "rehearse with `noisefloor-lab study simulate`, or `study serve --admit-simulated`";
        return refuse("simulated observers are not admitted", "simulated", do_.into());
    }
    let groups = &app.study.groups;
    if if groups.is_empty() { !group.is_empty() } else { !groups.contains(&group) } {
        return refuse("no such group", "group", format!("choose one of {groups:?}"));
    }
    let participants = &app.study.participants;
    let sound = |(name, value): (&String, &String)| {
        participants.id_parameters.contains(name)
            && value.len() <= MAX_ID
            && !value.contains(char::is_control)
    };
    if !ids.iter().all(sound) {
        let do_ = format!("send {:?} of at most {MAX_ID} bytes", participants.id_parameters);
        return refuse("an identifier of the address is unknown or too long", "ids", do_);
    }
    if participants.links_only && link.is_none() && !simulated {
        return refuse("this study is open to invited participants", "link", "use your personal link".into());
    }
    if link.is_none() && !simulated {
        app.guard.begins(client)?;
    }
    let link = link.map(|typed| code::parse(&typed).ok_or(StoreError::NoLink)).transpose()?;
    let (code, seed) = (code::draw()?, code::draw_seed()?);
    let plan = Plan::draw(&app.study, seed);
    let session = NewSession { code, seed, plan, group, simulated, ids, link };
    let code = app.store.begin(session).await?;
    let view = app.with(&code, |session| SessionView::of(&code, session)).await?;
    Ok((StatusCode::CREATED, Json(view)).into_response())
}

/// `GET /api/sessions/{code}`
pub(crate) async fn view(
    State(app): Shared,
    Extension(client): Peer,
    typed: Result<Path<String>, PathRejection>,
) -> Answer {
    let code = known_code(&app, client, typed)?;
    let view = app.with(&code, |session| SessionView::of(&code, session)).await;
    Ok(Json(counted(&app, client, &code, view)?).into_response())
}

/// `POST /api/sessions/{code}/events`
pub(crate) async fn event(
    State(app): Shared,
    Extension(client): Peer,
    typed: Result<Path<String>, PathRejection>,
    body: Body,
) -> Answer {
    let code = known_code(&app, client, typed)?;
    let envelope: Envelope = read_json(body).await?;
    if !envelope.has_sane_clock() {
        let do_ = "send milliseconds since 1970";
        return Err(Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, "the clock is out of range", "at", do_));
    }
    // Runs to its end even if who asked is gone: memory and disk stay the same
    let (worker, of) = (app.clone(), code.clone());
    let work = tokio::spawn(async move { worker.record(&of, envelope).await });
    let done = work.await.map_err(|_| Refusal::from(StoreError::Closed))?;
    let session = counted(&app, client, &code, done)?;
    Ok(Json(SessionView::of(&code, &session)).into_response())
}

/// `GET /api/sessions/{code}/export`
pub(crate) async fn export(
    State(app): Shared,
    Extension(client): Peer,
    typed: Result<Path<String>, PathRejection>,
) -> Answer {
    let code = known_code(&app, client, typed)?;
    let record = counted(&app, client, &code, app.store.load(&code).await.map_err(Refusal::from))?;
    let name = format!("attachment; filename=\"noisefloor-{code}.json\"");
    Ok(([(CONTENT_DISPOSITION, name)], Json(record)).into_response())
}

/// `DELETE /api/sessions/{code}`
pub(crate) async fn erase(
    State(app): Shared,
    Extension(client): Peer,
    typed: Result<Path<String>, PathRejection>,
) -> Answer {
    let code = known_code(&app, client, typed)?;
    let place = app.place(&code);
    let mut live = place.lock().await;
    let erased = app.store.erase(&code).await.map_err(Refusal::from);
    *live = None;
    app.forget(&code);
    counted(&app, client, &code, erased)?;
    Ok(StatusCode::NO_CONTENT.into_response())
}

/// `GET /api/tiles/{stack}/{level}/{tile}`, where the tile is `5.png`, or `5.2.png` for another frame than
/// the first
pub(crate) async fn tile(
    State(app): Shared,
    place: Result<Path<(String, String, String)>, PathRejection>,
) -> Answer {
    let no_tile =
        || Refusal::new(StatusCode::NOT_FOUND, "there is no such tile", "path", "ask for what a trial names");
    let Path((stack, level, tile)) = place.map_err(|_| no_tile())?;
    let number = |text: &str| text.parse::<u32>().map_err(|_| no_tile());
    let (stack, level) = (number(&stack)?, number(&level)?);
    let name = tile.strip_suffix(".png").ok_or_else(no_tile)?;
    let (tile, frame) = name.split_once('.').unwrap_or((name, "0"));
    let (tile, frame) = (number(tile)?, number(frame)?);
    let shape = app.study.stacks.get(stack as usize).ok_or_else(no_tile)?;
    if level > shape.last() || tile as usize >= shape.grid().len() || frame >= shape.frames() {
        return Err(no_tile());
    }
    let tiles = app.tiles.level((stack, level, frame)).await.map_err(|error| {
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
    client: Client,
    typed: Result<Path<String>, PathRejection>,
) -> Result<String, Refusal> {
    let typed = typed.map(|Path(typed)| typed).unwrap_or_default();
    code::parse(&typed).ok_or_else(|| app.guard.wrong_code(client, &typed))
}

/// Counts wrong codes of an address.
fn counted<T>(app: &App, client: Client, code: &str, result: Result<T, Refusal>) -> Result<T, Refusal> {
    result.map_err(|r| if r.is_unknown_code() { app.guard.wrong_code(client, code) } else { r })
}
