//! A calibration in the browser: one person, one page.

use super::course::{CHOICES, Calibration, CalibrationStage, Factor};
use super::tiles::{CalibrationTile, EDGE};
use crate::error::PagesError;
use crate::http::{
    ASK, Exposure, LOOK, Listening, PICTURE, PageFile, Refusal, SCRIPT, SHEET, STYLE, VIEWING, absent,
    interrupted, pages, read_json,
};
use crate::languages::{parse_language, read_languages};
use crate::viewing::{Conditions, ViewingLimits, ViewingProblem};
use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::StatusCode;
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use noisefloor::{Oracle, Viewing};
use noisefloor_eyes::{Person, SeenDisplay};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;

const PAGE: &str = include_str!("../../pages/calibrate/index.html");
const FILES: [PageFile; 7] = [
    ASK,
    ("calibrate.css", STYLE, include_str!("../../pages/calibrate/calibrate.css")),
    ("calibrate.js", SCRIPT, include_str!("../../pages/calibrate/calibrate.js")),
    PICTURE,
    SHEET,
    LOOK,
    VIEWING,
];
/// What this page says beyond the texts of studies.
const TEXTS: [(&str, &str); 2] = [
    ("en", include_str!("../../pages/calibrate/en.toml")),
    ("fr", include_str!("../../pages/calibrate/fr.toml")),
];

/// Takes what was found, and says where it is kept or why it is not.
type Keep = Box<dyn Fn(Person) -> Result<String, String> + Send + Sync>;

pub struct CalibrateSetup {
    /// Whose observers somebody is compared with.
    pub oracle: Oracle,
    pub name: String,
    /// Day of the measurement, as 2026-11-24.
    pub date: String,
    /// Seed of the order, the places and the noise.
    pub seed: u64,
    pub keep: Keep,
}

struct App {
    setup: CalibrateSetup,
    state: Mutex<Progress>,
    /// Told when something was kept.
    over: Notify,
}

#[derive(Default)]
struct Progress {
    conditions: Option<Conditions>,
    calibration: Option<Calibration>,
    /// Calibrations begun: each has noise and an order of its own.
    begun: u64,
    /// Where the result is, or why it is nowhere.
    kept: Option<Result<String, String>>,
}

impl App {
    fn state(&self) -> MutexGuard<'_, Progress> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A bound server, ready to run.
pub struct CalibrateServer {
    listening: Listening,
    app: Arc<App>,
    runtime: tokio::runtime::Runtime,
}

impl CalibrateServer {
    /// Binds the address. Port 0 picks a free port.
    pub fn bind(setup: CalibrateSetup, address: SocketAddr, exposure: &Exposure) -> Result<Self, PagesError> {
        let failed = |source: io::Error| PagesError::Listen { address: address.to_string(), source };
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build();
        let runtime = runtime.map_err(failed)?;
        let listening = runtime.block_on(Listening::bind(address, exposure))?;
        let app = Arc::new(App { setup, state: Mutex::default(), over: Notify::new() });
        Ok(Self { listening, app, runtime })
    }

    pub fn address(&self) -> SocketAddr {
        self.listening.address()
    }

    /// Serves until something was found and kept, or Ctrl-C. Returns where it is kept, or why it is not;
    /// `None` if it was interrupted.
    pub fn run(self) -> Option<Result<String, String>> {
        let Self { listening, app, runtime } = self;
        let stop = async {
            tokio::select! { () = app.over.notified() => (), () = interrupted() => () }
        };
        runtime.block_on(listening.serve(router(app.clone()), stop));
        app.state().kept.take()
    }
}

fn router(app: Arc<App>) -> Router {
    pages("", PAGE, &FILES)
        .route("/api/texts/{language}", get(texts))
        .route("/api/state", get(state))
        .route("/api/conditions", post(conditions))
        .route("/api/answer", post(answer))
        .route("/api/again", post(again))
        // As the tiles of a study are named: which picture, of which trial; it has one tile
        .route("/api/tiles/{choice}/{trial}/0.png", get(picture))
        .with_state(app)
}

type Shared = State<Arc<App>>;

fn stale() -> Refusal {
    Refusal::new(StatusCode::CONFLICT, "that is not what is asked now", "trial", "load the page again")
}

async fn texts(Path(code): Path<String>) -> Result<Json<BTreeMap<String, String>>, Refusal> {
    let own = TEXTS.iter().find(|(known, _)| *known == code);
    let (Some((_, own)), Ok(mut studies)) = (own, read_languages(None)) else {
        return Err(absent("the page is not in that language"));
    };
    let mut text = studies.remove(&code).map(|language| language.text).unwrap_or_default();
    text.extend(parse_language(own, std::path::Path::new(&code)).map(|own| own.text).unwrap_or_default());
    Ok(Json(text))
}

#[derive(Serialize)]
#[serde(tag = "stage", rename_all = "kebab-case")]
enum PageView {
    Conditions,
    Trial { number: u32, expected: u32, pictures: usize, edge: usize, conditions: Option<Conditions> },
    Found { factor: f64, interval: [f64; 2], answers: u32, kept: Option<String>, problem: Option<String> },
    Refused { what: String },
}

fn view(progress: &Progress) -> Json<PageView> {
    let Some(calibration) = &progress.calibration else { return Json(PageView::Conditions) };
    Json(match calibration.stage() {
        CalibrationStage::Asking(trial) => PageView::Trial {
            number: trial.number,
            expected: calibration.expected(),
            pictures: CHOICES,
            edge: EDGE,
            conditions: progress.conditions,
        },
        CalibrationStage::Found(Factor { factor, interval, answers, .. }) => {
            let (kept, problem) = match progress.kept.clone() {
                Some(Ok(kept)) => (Some(kept), None),
                Some(Err(problem)) => (None, Some(problem)),
                None => (None, None),
            };
            PageView::Found { factor, interval, answers, kept, problem }
        }
        CalibrationStage::Refused(refusal) => PageView::Refused { what: refusal.to_string() },
    })
}

/// `GET /api/state`
async fn state(State(app): Shared) -> Json<PageView> {
    view(&app.state())
}

/// `POST /api/conditions`: begins, unless something was begun.
async fn conditions(State(app): Shared, body: Body) -> Result<Json<PageView>, Refusal> {
    let refuse = |what: String| {
        Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, what, "conditions", "change it, and measure again")
    };
    let seen: Conditions = read_json(body).await?;
    // A second tab goes on with what the first has begun; `again` begins anew
    if app.state().calibration.is_some() {
        return Ok(view(&app.state()));
    }
    seen.check().map_err(refuse)?;
    if let Some(problem) = seen.outside(&ViewingLimits::default()) {
        let what = match problem {
            ViewingProblem::Distance => "the screen is too near or too far",
            ViewingProblem::PixelsPerDegree => "pixels are too coarse or too fine from this distance",
            ViewingProblem::Gamma => "the screen shows greys too bright or too dark",
            ViewingProblem::Ambient => "sun or lamps are reflected by the screen",
        };
        return Err(refuse(what.to_owned()));
    }
    let viewing =
        viewing(&seen).ok_or_else(|| refuse("the screen has an impossible resolution".to_owned()))?;
    let mut progress = app.state();
    let seed = app.setup.seed.wrapping_add(progress.begun);
    let begun = Calibration::new(&app.setup.oracle, viewing, seed);
    progress.begun += 1;
    progress.calibration = Some(begun.ok_or_else(|| refuse("this model cannot be calibrated".to_owned()))?);
    progress.conditions = Some(seen);
    Ok(view(&progress))
}

/// The default display, at the observer's pixels per degree.
fn viewing(seen: &Conditions) -> Option<Viewing> {
    let mut params = Viewing::default().params();
    params.pixels_per_degree = seen.pixels_per_degree();
    params.check().ok()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Answer {
    trial: u32,
    choice: usize,
}

/// `POST /api/answer`
async fn answer(State(app): Shared, body: Body) -> Result<Json<PageView>, Refusal> {
    let Answer { trial, choice } = read_json(body).await?;
    let mut progress = app.state();
    let Some(calibration) = &mut progress.calibration else { return Err(stale()) };
    if choice >= CHOICES || !calibration.answer(trial, choice) {
        return Err(stale());
    }
    if let (CalibrationStage::Found(found), Some(seen)) = (calibration.stage(), progress.conditions) {
        progress.kept = Some((app.setup.keep)(person(&app.setup, found, &seen)));
        app.over.notify_one();
    }
    Ok(view(&progress))
}

fn person(setup: &CalibrateSetup, found: Factor, seen: &Conditions) -> Person {
    Person {
        name: setup.name.clone(),
        factor: found.factor,
        interval: found.interval,
        scatter: found.scatter,
        answers: found.answers,
        date: setup.date.clone(),
        model: setup.oracle.model().digest(),
        display: SeenDisplay {
            pixels_per_degree: seen.pixels_per_degree(),
            distance_mm: seen.distance_mm,
            gamma: seen.gamma,
            ambient: seen.ambient.name().to_owned(),
        },
    }
}

/// `POST /api/again`: from the beginning, after a refusal or on another screen.
async fn again(State(app): Shared) -> Json<PageView> {
    let mut progress = app.state();
    if progress.kept.is_none() {
        (progress.calibration, progress.conditions) = (None, None);
    }
    view(&progress)
}

/// `GET /api/tiles/{choice}/{trial}/0.png`: made when asked for.
async fn picture(
    State(app): Shared,
    Path((choice, number)): Path<(usize, u32)>,
) -> Result<Response, Refusal> {
    let (trial, seed) = {
        let progress = app.state();
        let stage = progress.calibration.as_ref().map(Calibration::stage);
        let Some(CalibrationStage::Asking(trial)) = stage else { return Err(stale()) };
        (trial, app.setup.seed.wrapping_add(progress.begun << 32).wrapping_add(u64::from(number)))
    };
    if trial.number != number || choice >= CHOICES {
        return Err(stale());
    }
    let tile = &CalibrationTile::all()[trial.tile];
    let pixels = if choice == trial.noisy { tile.noisy(trial.spp, seed) } else { tile.clean().to_vec() };
    let mut png = Vec::new();
    let edge = EDGE as u32;
    let written =
        PngEncoder::new(&mut png).write_image(pixels.as_flattened(), edge, edge, ExtendedColorType::Rgb8);
    written.map_err(|_| absent("the picture cannot be written"))?;
    Ok(([(CONTENT_TYPE, "image/png"), (CACHE_CONTROL, "no-store")], png).into_response())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// A second tab goes on with the answers of the first; only `again` throws them away.
    #[test]
    fn a_second_tab_joins_the_first() {
        let setup = CalibrateSetup {
            oracle: Oracle::bundled(),
            name: "me".to_owned(),
            date: "2026-11-25".to_owned(),
            seed: 1,
            keep: Box::new(|_| Ok(String::new())),
        };
        let server = CalibrateServer::bind(setup, ([127, 0, 0, 1], 0).into(), &Exposure::default()).unwrap();
        let url = format!("http://{}/api", server.address());
        std::thread::spawn(move || server.run());
        let post = |path: &str, body: &Value| -> Value {
            let request = ureq::post(format!("{url}/{path}")).header("content-type", "application/json");
            let mut reply = request.send(body.to_string()).unwrap();
            serde_json::from_str(&reply.body_mut().read_to_string().unwrap()).unwrap()
        };
        let seen = json!({
            "pixels-per-mm": 3.78, "distance-mm": 600, "pixel-ratio": 1, "zoom": 1, "colour-depth": 24,
            "screen-width": 1920, "screen-height": 1080, "gamma": 2.2, "ambient": "dim",
        });
        let begun = post("conditions", &seen);
        assert_eq!(begun["stage"], "trial", "{begun}");
        let first = begun["number"].clone();
        let answered = post("answer", &json!({ "trial": first, "choice": 0 }));
        assert_ne!(answered["number"], first, "{answered}");
        assert_eq!(post("conditions", &seen), answered);
        assert_eq!(post("again", &json!({}))["stage"], "conditions");
        assert_eq!(post("conditions", &seen)["number"], first);
    }
}
