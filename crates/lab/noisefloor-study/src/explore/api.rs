//! Requests about the initial state and the pictures. Replies are JSON, except pictures and models.

use super::answers::Disagreements;
use super::app::App;
use super::gallery::{GalleryError, GalleryPicture, PictureView};
use super::images;
use super::verdicts::{Tiles, jods_lost};
use crate::error::{StoreError, StudyError};
use axum::Json;
use axum::body::Body;
use axum::extract::rejection::PathRejection;
use axum::extract::{Path, State};
use axum::http::header::{CONTENT_LENGTH, CONTENT_TYPE};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use noisefloor::{
    Audience, People,
    evidence::{Evidence, Samples},
    stills::StillError,
};
use noisefloor_pages::http::{Refusal, read_bytes, read_json};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;

/// Longest file, in bytes: enough for a picture of the most pixels in 16-bit floats.
const MAX_FILE: usize = 384 << 20;
const FILE_TIME: Duration = Duration::from_secs(120);
/// Longest name of a file or a scene, in bytes.
const MAX_NAME: usize = 200;

const RELOAD: &str = "load the page again";

pub(crate) type Answer = Result<Response, Refusal>;
pub(crate) type Shared = State<Arc<App>>;
pub(crate) type Named = Result<Path<String>, PathRejection>;

impl From<GalleryError> for Refusal {
    fn from(error: GalleryError) -> Self {
        let (place, do_) = match &error {
            GalleryError::Gone => {
                return Self::new(StatusCode::NOT_FOUND, error.to_string(), "pictures", RELOAD);
            }
            GalleryError::NoSamples(_) => ("pictures", "type the number beside its name"),
            GalleryError::Still(StillError::Nothing) => {
                ("pictures", "drop another rendering of the same view beside it")
            }
            GalleryError::Still(StillError::Undecided { .. } | StillError::Dependent { .. }) => {
                ("relation", "choose it under `Scene, relation, tiles`")
            }
            GalleryError::Many | GalleryError::Large => ("pictures", "take some away"),
            _ => {
                ("pictures", "see `noisefloor judge --help` for what pictures can be held against each other")
            }
        };
        refuse(error.to_string(), place, do_)
    }
}

pub(crate) fn refuse(what: impl Into<String>, place: &str, do_: &str) -> Refusal {
    Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, what, place, do_)
}

pub(crate) fn gone(place: &str) -> Refusal {
    Refusal::new(StatusCode::NOT_FOUND, "there is no such thing", place, RELOAD)
}

/// The state the page starts from.
#[derive(Serialize)]
struct StateView {
    pictures: Vec<PictureView>,
    scene: String,
    /// The name given to the scene, if any.
    named: Option<String>,
    tile: usize,
    /// `nested`, `independent`, or null to detect it from the pictures.
    samples: Option<&'static str>,
    people: People,
    audience: [f64; 2],
    art_students: [f64; 2],
    model: ModelView,
    retrained: bool,
    disagreements: usize,
    database: String,
    /// Whether there is a table to retrain on.
    table: bool,
}

#[derive(Serialize)]
struct ModelView {
    digest: String,
    evidence: Evidence,
}

/// `GET /api/state`
pub(crate) async fn state(State(app): Shared) -> Answer {
    let disagreements = kept(&app, |kept| kept.all().map(|all| all.len())).await?;
    let (gallery, setup) = (app.gallery().clone(), &app.setup);
    let Audience { slope, offset } = setup.audience;
    let students = Audience::ART_STUDENTS;
    Ok(Json(StateView {
        pictures: gallery.pictures.iter().map(GalleryPicture::view).collect(),
        scene: gallery.scene(),
        named: gallery.named.clone(),
        tile: gallery.tile,
        samples: gallery.samples.map(|s| if s == Samples::Nested { "nested" } else { "independent" }),
        people: setup.people,
        audience: [slope, offset],
        art_students: [students.slope, students.offset],
        model: ModelView { digest: setup.model.digest(), evidence: setup.model.evidence() },
        retrained: app.job().model().is_some(),
        disagreements,
        database: setup.database.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
        table: setup.table.is_some(),
    })
    .into_response())
}

/// `POST /api/pictures/{name}`: the file as it is.
pub(crate) async fn add(State(app): Shared, name: Named, headers: HeaderMap, body: Body) -> Answer {
    let name = name.map(|Path(name)| name).unwrap_or_default();
    if name.is_empty()
        || name.len() > MAX_NAME
        || name.chars().any(|c| c.is_control() || c == '/' || c == '\\')
    {
        return Err(refuse(
            format!("a file name of 1 to {MAX_NAME} bytes is needed"),
            "path",
            "rename the file",
        ));
    }
    let announced = headers.get(CONTENT_LENGTH).and_then(|n| n.to_str().ok()?.parse::<u64>().ok());
    if announced.is_some_and(|n| n > MAX_FILE as u64) {
        let what = format!("{name} is longer than {MAX_FILE} bytes");
        return Err(Refusal::new(StatusCode::PAYLOAD_TOO_LARGE, what, "body", "crop the picture"));
    }
    // One upload at a time bounds the memory
    let _turn = app.incoming.lock().await;
    let bytes = read_bytes(body, MAX_FILE, FILE_TIME, "crop the picture").await?;
    let (worker, of) = (app.clone(), name.clone());
    let work = move || -> Result<String, Refusal> {
        let unreadable = |error: &dyn std::fmt::Display, folder: &std::path::Path| {
            // The temporary path means nothing to the person who uploaded the file
            let said = error.to_string().replace(&format!("{}/", folder.display()), "");
            refuse(said, "body", "PNG, EXR and PFM files can be read")
        };
        let folder = tempfile::tempdir()
            .map_err(|e| refuse(e.to_string(), "disk", "make room for temporary files"))?;
        let path = folder.path().join(&of);
        std::fs::write(&path, &bytes).map_err(|e| unreadable(&e, folder.path()))?;
        drop(bytes);
        let layer = worker.setup.layer.as_deref();
        let picture = GalleryPicture::read(&path, layer).map_err(|e| unreadable(&e, folder.path()))?;
        let id = picture.id.clone();
        worker.gallery().add(picture)?;
        Ok(id)
    };
    let id = blocking(work).await??;
    let gallery = app.gallery();
    let view = gallery.pictures.iter().find(|p| p.id == id).map(GalleryPicture::view);
    Ok((StatusCode::CREATED, Json(view.ok_or_else(|| gone("pictures"))?)).into_response())
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Change {
    spp: f64,
}

/// `PUT /api/pictures/{id}`: sets its samples per pixel.
pub(crate) async fn change(State(app): Shared, id: Named, body: Body) -> Answer {
    let Path(id) = id.map_err(|_| gone("pictures"))?;
    let Change { spp } = read_json(body).await?;
    app.gallery().set_spp(&id, spp)?;
    state(State(app)).await
}

/// `DELETE /api/pictures/{id}`
pub(crate) async fn remove(State(app): Shared, id: Named) -> Answer {
    let Path(id) = id.map_err(|_| gone("pictures"))?;
    app.gallery().remove(&id)?;
    state(State(app)).await
}

/// `DELETE /api/pictures`
pub(crate) async fn clear(State(app): Shared) -> Answer {
    app.gallery().clear();
    state(State(app)).await
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Arrangement {
    tile: usize,
    samples: Option<String>,
    scene: Option<String>,
}

/// `PUT /api/arrangement`
pub(crate) async fn arrange(State(app): Shared, body: Body) -> Answer {
    let Arrangement { tile, samples, scene } = read_json(body).await?;
    let samples = match samples.as_deref() {
        None => None,
        Some("nested") => Some(Samples::Nested),
        Some("independent") => Some(Samples::Independent),
        Some(_) => {
            return Err(refuse("samples are nested, independent, or null", "samples", "choose one of them"));
        }
    };
    let scene = scene.map(|s| s.trim().to_owned()).filter(|s| !s.is_empty());
    if scene.as_ref().is_some_and(|s| s.len() > MAX_NAME || s.chars().any(char::is_control)) {
        return Err(refuse(format!("a name of at most {MAX_NAME} bytes is needed"), "scene", "shorten it"));
    }
    app.gallery().arrange(tile, samples, scene)?;
    state(State(app)).await
}

/// Most stops by which a picture is shown brighter or darker.
const MOST_STOPS: f32 = 20.0;

/// `GET /api/pictures/{id}/shown.png?stops=0`: `stops` says by how many it is shown brighter.
pub(crate) async fn shown(State(app): Shared, id: Named, uri: Uri) -> Answer {
    let tiles = tiles(&app, id).await?;
    let asked = uri
        .query()
        .into_iter()
        .flat_map(|query| query.split('&'))
        .find_map(|pair| pair.strip_prefix("stops="));
    let stops = asked.map_or(Ok(0.0), str::parse).ok().filter(|stops: &f32| stops.abs() <= MOST_STOPS);
    let Some(stops) = stops else {
        return Err(refuse("that is no exposure in stops", "stops", "ask for a number from -20 to 20"));
    };
    png(move || images::shown(&tiles, stops)).await
}

/// `GET /api/pictures/{id}/noise.png`
pub(crate) async fn noise(State(app): Shared, id: Named) -> Answer {
    let tiles = tiles(&app, id).await?;
    if tiles.noise.is_none() {
        return Err(Refusal::new(
            StatusCode::NOT_FOUND,
            "this model has no map of visible noise",
            "model",
            "use one with the visible descriptor",
        ));
    }
    png(move || images::noise(&tiles).unwrap_or_else(|| Ok(Vec::new()))).await
}

/// `GET /api/pictures/{id}/lost.png`: the map of JODs lost.
pub(crate) async fn lost(State(app): Shared, id: Named) -> Answer {
    let Path(id) = id.map_err(|_| gone("pictures"))?;
    let worker = app.clone();
    let work = move || {
        // One at a time bounds the memory
        let _turn = worker.judged.blocking_lock();
        let gallery = worker.gallery().clone();
        let map = jods_lost(&gallery, &id, &worker.setup.model, worker.setup.viewing)?;
        Ok::<_, GalleryError>((gallery.pictures.iter().find(|p| p.id == id).map(|p| p.still.size), map))
    };
    let (size, map) = blocking(work).await??;
    let size = size.ok_or_else(|| gone("pictures"))?;
    png(move || images::lost(size, &map)).await
}

async fn png(make: impl FnOnce() -> Result<Vec<u8>, image::ImageError> + Send + 'static) -> Answer {
    let broken = |e: image::ImageError| refuse(e.to_string(), "pictures", RELOAD);
    let bytes = blocking(make).await?.map_err(broken)?;
    Ok(([(CONTENT_TYPE, "image/png")], bytes).into_response())
}

async fn tiles(app: &Arc<App>, id: Named) -> Result<Arc<Tiles>, Refusal> {
    let Path(id) = id.map_err(|_| gone("pictures"))?;
    describe(app, &id).await
}

/// The tiles of a picture, described once and cached.
pub(crate) async fn describe(app: &Arc<App>, id: &str) -> Result<Arc<Tiles>, Refusal> {
    let (worker, id) = (app.clone(), id.to_owned());
    let work = move || {
        let gallery = worker.gallery().clone();
        worker.judged.blocking_lock().tiles(&gallery, &id, &worker.setup.model, worker.setup.viewing)
    };
    Ok(blocking(work).await??)
}

/// Runs database work on a thread that may block.
pub(crate) async fn kept<T: Send + 'static>(
    app: &Arc<App>,
    work: impl FnOnce(&Disagreements) -> Result<T, StoreError> + Send + 'static,
) -> Result<T, Refusal> {
    let kept = app.kept.clone();
    Ok(blocking(move || work(&kept)).await??)
}

pub(crate) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Refusal> {
    let ended = |_| {
        let what = "the work ended early";
        Refusal::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            what,
            "server",
            "look at what `noisefloor-lab explore` printed",
        )
    };
    tokio::task::spawn_blocking(work).await.map_err(ended)
}

impl From<StudyError> for Refusal {
    fn from(error: StudyError) -> Self {
        refuse(error.to_string(), "pictures", "see docs/studies.md")
    }
}
