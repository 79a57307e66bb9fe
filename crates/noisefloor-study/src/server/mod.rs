//! The server: pages, pictures and events over HTTP, for this machine alone unless it is told otherwise.

mod api;
mod app;
mod pages;
mod tiles;
mod views;

pub use views::{Beginning, SessionView, StackView, StudyView};

use crate::config::Study;
use crate::error::StudyError;
use crate::http::{self, Guard, Listening};
use crate::session;
use crate::store::AnswerStore;
use app::App;
use axum::Router;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::{get, post};
use std::future::Future;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use tiles::TileCache;

/// A server that listens, and is yet to be run.
#[derive(Debug)]
pub struct StudyServer {
    listening: Listening,
    router: Router,
}

impl StudyServer {
    /// Opens the answers of a study and listens. `address` with port 0 takes a free port. Requests have to
    /// name the server as `address`, as `localhost`, or as one of `names` (host or host:port): a page
    /// elsewhere that has its own name resolve to this machine is turned away.
    ///
    /// # Errors
    /// [`StudyError`] if the answers cannot be opened, or the address is taken.
    pub async fn bind(study: Arc<Study>, address: SocketAddr, names: &[String]) -> Result<Self, StudyError> {
        let store = AnswerStore::open(&study.database, &study.design())?;
        let listening = Listening::bind(address).await?;
        let app = Arc::new(App {
            grids: session::grids(&study),
            tiles: TileCache::new(study.clone()),
            guard: Arc::new(Guard::new(listening.address(), names)),
            live: Mutex::default(),
            store,
            study,
        });
        Ok(Self { listening, router: router(app) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.listening.address()
    }

    /// Serves until `stop` is ready, and answers what has come until then.
    ///
    /// # Errors
    /// [`StudyError::Listen`] if the system takes the socket away.
    pub async fn run(self, stop: impl Future<Output = ()> + Send + 'static) -> Result<(), StudyError> {
        self.listening.serve(self.router, stop).await;
        Ok(())
    }
}

fn router(app: Arc<App>) -> Router {
    Router::new()
        .route("/", get(pages::page))
        .route("/{file}", get(pages::file))
        .route("/api/study", get(api::study))
        .route("/api/sessions", post(api::begin))
        .route("/api/sessions/{code}", get(api::view).delete(api::erase))
        .route("/api/sessions/{code}/events", post(api::event))
        .route("/api/sessions/{code}/export", get(api::export))
        .route("/api/tiles/{stack}/{level}/{tile}", get(api::tile))
        .fallback(http::nothing_here)
        .method_not_allowed_fallback(http::wrong_method)
        .layer(from_fn_with_state(app.guard.clone(), http::check))
        .layer(from_fn(http::security_headers))
        .with_state(app)
}
