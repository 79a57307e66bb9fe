//! A page on which a render is watched: the picture so far, the tiles that are open, and the time left.
//!
//! Whoever renders [publishes](LiveRender::publish) states and pictures; a [`WatchServer`] hands out the latest ones.

use crate::error::PagesError;
use crate::http::{Exposure, LOOK, Listening, PageFile, SCRIPT, STYLE, absent, pages};
use axum::Router;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use serde::Serialize;
use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// A page that has asked for nothing for so long is closed.
const GONE: Duration = Duration::from_secs(10);

const PAGE: &str = include_str!("../pages/watch/index.html");
const FILES: [PageFile; 3] = [
    ("watch.js", SCRIPT, include_str!("../pages/watch/watch.js")),
    LOOK,
    ("watch.css", STYLE, include_str!("../pages/watch/watch.css")),
];

#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct LiveState {
    pub scene: String,
    pub source: String,
    pub width: usize,
    pub height: usize,
    /// Since the render began.
    pub seconds: f64,
    /// How many more it is expected to take; `None` while that is not known.
    pub eta_seconds: Option<f64>,
    pub over: bool,
    /// All tiles, row-major.
    pub tiles: Vec<LiveTile>,
    /// Number of the latest picture; 0 for none yet.
    picture: u64,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub struct LiveTile {
    /// Left edge in pixels.
    pub x: usize,
    /// Top edge in pixels.
    pub y: usize,
    pub width: usize,
    pub height: usize,
    pub spp: u64,
    /// Probability, 0…1, that nobody sees noise, by the latest verdict.
    pub probability: Option<f32>,
    /// Whether it gets more samples.
    pub open: bool,
    /// What keeps it from being done, as reports have it; `None` if nothing does.
    pub open_for: Option<&'static str>,
}

impl LiveState {
    /// A render that has not begun.
    pub fn new(scene: &str, source: &str) -> Self {
        Self {
            scene: scene.to_owned(),
            source: source.to_owned(),
            width: 0,
            height: 0,
            seconds: 0.0,
            eta_seconds: None,
            over: false,
            tiles: Vec::new(),
            picture: 0,
        }
    }

    /// The same, this much later: a render's clock runs on between its batches.
    fn after(&self, pause: Duration) -> Self {
        let seconds = if self.over { 0.0 } else { pause.as_secs_f64() };
        let eta_seconds = self.eta_seconds.map(|eta| (eta - seconds).max(0.0));
        Self { seconds: self.seconds + seconds, eta_seconds, ..self.clone() }
    }
}

/// The latest state and picture of a render.
#[derive(Debug, Default)]
pub struct LiveRender(Mutex<Latest>);

#[derive(Debug, Default)]
struct Latest {
    state: Option<(LiveState, Instant)>,
    /// Shared by all who read it.
    png: Bytes,
    picture: u64,
    /// When a page asked last.
    asked: Option<Instant>,
}

impl LiveRender {
    fn latest(&self) -> MutexGuard<'_, Latest> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Replaces the state, and the picture if there is a new one (a PNG).
    pub fn publish(&self, state: &LiveState, picture: Option<Vec<u8>>) {
        let mut latest = self.latest();
        if let Some(png) = picture {
            latest.png = png.into();
            latest.picture += 1;
        }
        latest.state = Some((LiveState { picture: latest.picture, ..state.clone() }, Instant::now()));
    }

    /// The latest picture, without a copy.
    fn png(&self) -> Bytes {
        self.latest().png.clone()
    }

    /// Whether a page is open: pictures need not be made for nobody.
    pub fn is_watched(&self) -> bool {
        self.latest().asked.is_some_and(|asked| asked.elapsed() < GONE)
    }
}

/// Serves the page, in a thread of its own, as long as the process runs.
#[derive(Debug)]
pub struct WatchServer;

impl WatchServer {
    /// Binds an address, of which port 0 picks a free port, and serves; returns the bound address.
    ///
    /// # Errors
    /// [`PagesError::Listen`] if the address is in use or not of this machine, or there is no thread for it.
    pub fn start(
        live: Arc<LiveRender>,
        address: SocketAddr,
        exposure: &Exposure,
    ) -> Result<SocketAddr, PagesError> {
        let failed = |source: io::Error| PagesError::Listen { address: address.to_string(), source };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
        let listening = runtime.block_on(Listening::bind(address, exposure))?;
        let bound = listening.address();
        let routes = Router::new().route("/api/state", get(state)).route("/api/picture.png", get(picture));
        let router = pages("", PAGE, &FILES).merge(routes).with_state(live);
        let serve = move || runtime.block_on(listening.serve(router, std::future::pending()));
        thread::Builder::new().name("watch".into()).spawn(serve).map_err(failed)?;
        Ok(bound)
    }
}

async fn state(State(live): State<Arc<LiveRender>>) -> Response {
    let mut latest = live.latest();
    latest.asked = Some(Instant::now());
    match &latest.state {
        Some((state, since)) => axum::Json(state.after(since.elapsed())).into_response(),
        None => absent("the render has not begun").into_response(),
    }
}

async fn picture(State(live): State<Arc<LiveRender>>) -> Response {
    let png = live.png();
    if png.is_empty() {
        return absent("there is no picture yet").into_response();
    }
    ([(CONTENT_TYPE, "image/png")], png).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sixty readers of a large picture need the memory of one.
    #[test]
    fn readers_share_the_picture() {
        let live = LiveRender::default();
        live.publish(&LiveState::new("hall", "ptwne"), Some(vec![1; 1 << 20]));
        let [one, other] = [live.png(), live.png()];
        assert_eq!((one.as_ptr(), one.len()), (other.as_ptr(), 1 << 20));
    }

    /// In Chromium, where there is one: what tiles are open for, under the colours of their frames in maps.
    #[test]
    fn the_page_names_what_tiles_wait_for() {
        let (live, mut state) = (Arc::new(LiveRender::default()), LiveState::new("hall", "ptwne"));
        let named = ["noise", "exposure", "unmet-light", "few-samples", "doubt"];
        let tile = |(i, why)| LiveTile {
            x: 8 * i,
            y: 0,
            width: 8,
            height: 8,
            spp: 16,
            probability: None,
            open: true,
            open_for: Some(why),
        };
        (state.width, state.height) = (40, 8);
        state.tiles = named.into_iter().enumerate().map(tile).collect();
        live.publish(&state, None);
        let address = WatchServer::start(live, ([127, 0, 0, 1], 0).into(), &Exposure::default()).unwrap();
        let mut browser = std::process::Command::new("chromium");
        browser.args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--virtual-time-budget=3000",
            "--dump-dom",
        ]);
        let Ok(shown) = browser.arg(format!("http://{address}")).output() else {
            return eprintln!("not tested: there is no chromium");
        };
        let shown = String::from_utf8(shown.stdout).unwrap();
        let colours = ["90, 170, 255", "255, 210, 40", "120, 230, 120", "255, 90, 90"];
        for (why, colour) in named[1..].iter().zip(colours) {
            let key = format!("solid rgba({colour}, 0.9);\">1 open for {why}</span>");
            assert!(shown.contains(&key), "{key}: {shown}");
        }
    }
}
