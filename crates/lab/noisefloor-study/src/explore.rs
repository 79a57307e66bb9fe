//! Your own pictures in the browser: verdicts per tile, disagreements, and retraining.
//!
//! Pictures ([`GalleryPicture`]) stay in memory and are judged as by `noisefloor judge`. Disagreements are
//! stored in a database ([`Disagreements`]). [`retrain`] learns from them and reports the effect. Nothing
//! leaves the machine.

mod answers;
mod api;
mod app;
mod ask;
mod gallery;
mod images;
mod job;
mod learn;
mod line;
mod pages;
mod verdicts;

pub use answers::{Disagreement, Disagreements, TileAnswer, read_answers};
pub use app::ExploreSetup;
pub use gallery::GalleryPicture;
pub use learn::{AnswerAgreement, LearnStep, Learned, retrain};
pub use line::{PersonalLine, fit_line};

use crate::error::StudyError;
use app::App;
use axum::Router;
use axum::routing::{delete, get, post, put};
use gallery::Gallery;
use noisefloor::text::told_apart;
use noisefloor_pages::http::{self, Exposure, Listening};
use std::future::Future;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// A bound server, ready to run.
#[derive(Debug)]
pub struct ExploreServer {
    listening: Listening,
    router: Router,
}

impl ExploreServer {
    /// Reads the pictures, opens the database and binds the address. Port 0 picks a free port. `exposure`
    /// says under which other names and behind which proxies it may be reached; a base path is ignored.
    pub async fn bind(
        setup: ExploreSetup,
        address: SocketAddr,
        exposure: &Exposure,
    ) -> Result<Self, StudyError> {
        let mut gallery = Gallery::new(setup.tile);
        let names = told_apart(&setup.pictures.iter().map(PathBuf::as_path).collect::<Vec<_>>());
        for (path, name) in setup.pictures.iter().zip(names) {
            gallery
                .add(GalleryPicture::read(path, setup.layer.as_deref())?.called(name))
                .map_err(|error| StudyError::Other(error.to_string()))?;
        }
        let kept = Arc::new(Disagreements::open(&setup.database)?);
        let listening = Listening::bind(address, exposure).await?;
        let app = Arc::new(App {
            setup,
            kept,
            gallery: Mutex::new(gallery),
            judged: tokio::sync::Mutex::default(),
            incoming: tokio::sync::Mutex::default(),
            job: Arc::default(),
        });
        Ok(Self { listening, router: router(app) })
    }

    pub fn address(&self) -> SocketAddr {
        self.listening.address()
    }

    pub async fn run(self, stop: impl Future<Output = ()> + Send + 'static) -> Result<(), StudyError> {
        self.listening.serve(self.router, stop).await;
        Ok(())
    }
}

fn router(app: Arc<App>) -> Router {
    http::pages("", pages::PAGE, &pages::FILES)
        .route("/api/texts/{language}", get(pages::texts))
        .route("/api/state", get(api::state))
        .route("/api/arrangement", put(api::arrange))
        .route("/api/pictures", delete(api::clear))
        .route("/api/pictures/{name}", post(api::add).put(api::change).delete(api::remove))
        .route("/api/pictures/{name}/shown.png", get(api::shown))
        .route("/api/pictures/{name}/noise.png", get(api::noise))
        .route("/api/pictures/{name}/lost.png", get(api::lost))
        .route("/api/verdicts", post(ask::verdicts))
        .route("/api/disagreements", post(ask::disagree))
        .route("/api/disagreements/{id}", delete(ask::take_back))
        .route("/api/line", post(ask::line))
        .route("/api/retrain", get(ask::progress).post(ask::retrain))
        .route("/api/retrained.nfm", get(ask::retrained))
        .with_state(app)
}
