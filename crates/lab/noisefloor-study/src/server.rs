//! The server: pages, pictures and events over HTTP.

mod api;
mod app;
mod overview;
mod pages;
mod tiles;
mod views;

pub use overview::{Overview, OverviewRow};
pub use views::{Beginning, CompletionView, LanguageView, SessionView, StackView, StudyView};

use crate::code;
use crate::config::Study;
use crate::error::StudyError;
use crate::session;
use crate::store::AnswerStore;
use app::App;
use axum::Router;
use axum::response::Redirect;
use axum::routing::{get, post};
use noisefloor_pages::http::{self, Exposure, Listening};
use std::future::Future;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use tiles::TileCache;

/// A bound server, ready to run.
pub struct StudyServer {
    listening: Listening,
    base_path: String,
    app: Arc<App>,
}

impl StudyServer {
    /// Opens the answers of a study and binds the address. Port 0 picks a free port. `exposure` says under
    /// which other names, behind which proxies and under which path the server may be reached.
    pub async fn bind(
        study: Arc<Study>,
        address: SocketAddr,
        exposure: &Exposure,
    ) -> Result<Self, StudyError> {
        let store = AnswerStore::open(&study.database, &study.design())?;
        let listening = Listening::bind(address, exposure).await?;
        let app = Arc::new(App {
            grids: session::grids(&study),
            tiles: TileCache::new(study.clone()),
            guard: listening.guard(),
            live: Mutex::default(),
            key: code::draw()?,
            simulated: AtomicBool::new(false),
            store,
            study,
        });
        Ok(Self { listening, base_path: exposure.base_path.clone(), app })
    }

    /// Admits [simulated observers](crate::simulated), who need no link and get no completion code: for a
    /// rehearsal. Otherwise they are refused.
    #[must_use]
    pub fn admitting_simulated(self) -> Self {
        self.app.simulated.store(true, Ordering::Relaxed);
        self
    }

    pub fn address(&self) -> SocketAddr {
        self.listening.address()
    }

    /// Path of the experimenter's page with its key, to be put after the address that browsers use.
    pub fn experimenter_path(&self) -> String {
        format!("{}/experimenter.html#{}", self.base_path, self.app.key)
    }

    /// Serves until `stop` resolves, and answers the requests that arrived until then.
    pub async fn run(self, stop: impl Future<Output = ()> + Send + 'static) -> Result<(), StudyError> {
        self.listening.serve(router(self.app, &self.base_path), stop).await;
        Ok(())
    }
}

fn router(app: Arc<App>, base: &str) -> Router {
    let at = |path: &str| format!("{base}{path}");
    let mut router = http::pages(base, pages::PAGE, &pages::FILES)
        .route(&at("/api/study"), get(api::study))
        .route(&at("/api/texts/{language}"), get(api::texts))
        .route(&at("/api/overview"), get(overview::overview))
        .route(&at("/api/sessions"), post(api::begin))
        .route(&at("/api/sessions/{code}"), get(api::view).delete(api::erase))
        .route(&at("/api/sessions/{code}/events"), post(api::event))
        .route(&at("/api/sessions/{code}/export"), get(api::export))
        .route(&at("/api/tiles/{stack}/{level}/{tile}"), get(api::tile));
    if !base.is_empty() {
        let page = at("/");
        router = router.route(base, get(move || async move { Redirect::permanent(&page) }));
    }
    router.with_state(app)
}
