//! One's own pictures in the browser: what the model says of each tile, what people say against it, and what it learns from them.
//!
//! Pictures ([`Picture`]) are held in memory, judged as `noisefloor judge` judges them, and shown; disagreements are kept in a
//! database ([`Disagreements`]), and [`retrain`] learns from them and says what that has cost and gained. Nothing leaves the machine.

mod answers;
mod api;
mod ask;
mod gallery;
mod images;
mod job;
mod learn;
mod pages;
mod verdicts;

pub use answers::{Disagreement, Disagreements, Said, read_answers};
pub use gallery::{MAX_PICTURES, MAX_PIXELS, Picture};
pub use learn::{Agreement, Learned, Step, retrain};

use crate::error::StudyError;
use crate::server::guard::{self, Guard};
use axum::Router;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::{delete, get, post, put};
use gallery::Gallery;
use job::Job;
use noisefloor::{Audience, DEFAULT_TILE, Model};
use noisefloor_learn::Table;
use std::future::Future;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::net::TcpListener;
use verdicts::Judged;

/// What is explored with.
#[derive(Debug)]
pub struct Setup {
    /// Judges.
    pub model: Model,
    /// P from which a tile counts as converged, until the page says otherwise.
    pub threshold: f32,
    /// Whose eyes, until the page says otherwise.
    pub audience: Audience,
    /// Tile edge in pixels, 16…512, until the page says otherwise.
    pub tile: usize,
    /// Where disagreements are kept.
    pub database: PathBuf,
    /// Human thresholds to train on beside disagreements; without, the page cannot retrain.
    pub table: Option<Table>,
    /// Pictures to begin with: file, and samples per pixel where they are known.
    pub pictures: Vec<PathBuf>,
}

impl Setup {
    /// The bundled model, with everything as it is by default, and disagreements in `database`.
    pub fn new(database: impl AsRef<Path>) -> Self {
        Self {
            model: Model::bundled(),
            threshold: noisefloor::DEFAULT_THRESHOLD,
            audience: Audience::TRAINED,
            tile: DEFAULT_TILE,
            database: database.as_ref().to_owned(),
            table: None,
            pictures: Vec::new(),
        }
    }
}

/// Everything that requests share.
pub(crate) struct App {
    setup: Setup,
    kept: Arc<Disagreements>,
    gallery: Mutex<Gallery>,
    /// Pictures judged; locked while one is.
    judged: tokio::sync::Mutex<Judged>,
    /// Locked while a picture comes in: one at a time bounds the memory.
    incoming: tokio::sync::Mutex<()>,
    job: Arc<Mutex<Job>>,
}

impl App {
    fn gallery(&self) -> MutexGuard<'_, Gallery> {
        self.gallery.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn job(&self) -> MutexGuard<'_, Job> {
        self.job.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A server that listens, and is yet to be run.
#[derive(Debug)]
pub struct Explorer {
    listener: TcpListener,
    router: Router,
    address: SocketAddr,
}

impl Explorer {
    /// Reads the pictures, opens the database and listens. `address` with port 0 takes a free port; `names` are other names of this machine
    /// by which it may be asked for.
    ///
    /// # Errors
    /// [`StudyError`] if a picture cannot be read, the database not be opened, or the address is taken.
    pub async fn bind(setup: Setup, address: SocketAddr, names: &[String]) -> Result<Self, StudyError> {
        let mut gallery = Gallery::new(setup.tile);
        for path in &setup.pictures {
            gallery.add(Picture::read(path)?).map_err(|error| StudyError::Explore(error.to_string()))?;
        }
        let kept = Arc::new(Disagreements::open(&setup.database)?);
        let failed = |source| StudyError::Listen { address: address.to_string(), source };
        let listener = TcpListener::bind(address).await.map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let app = Arc::new(App {
            setup,
            kept,
            gallery: Mutex::new(gallery),
            judged: tokio::sync::Mutex::default(),
            incoming: tokio::sync::Mutex::default(),
            job: Arc::default(),
        });
        let guard = Arc::new(Guard::new(address, names));
        Ok(Self { listener, router: router(app, guard), address })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves until `stop` is ready.
    ///
    /// # Errors
    /// [`StudyError::Listen`] if the system takes the socket away.
    pub async fn run(self, stop: impl Future<Output = ()> + Send + 'static) -> Result<(), StudyError> {
        let address = self.address.to_string();
        let service = self.router.into_make_service_with_connect_info::<SocketAddr>();
        let served = axum::serve(self.listener, service).with_graceful_shutdown(stop).await;
        served.map_err(|source| StudyError::Listen { address, source })
    }
}

fn router(app: Arc<App>, guard: Arc<Guard>) -> Router {
    Router::new()
        .route("/", get(pages::page))
        .route("/{file}", get(pages::file))
        .route("/api/state", get(api::state))
        .route("/api/arrangement", put(api::arrange))
        .route("/api/pictures", delete(api::clear))
        .route("/api/pictures/{name}", post(api::add).put(api::change).delete(api::remove))
        .route("/api/pictures/{name}/shown.png", get(api::shown))
        .route("/api/pictures/{name}/noise.png", get(api::noise))
        .route("/api/verdicts", post(ask::verdicts))
        .route("/api/disagreements", post(ask::disagree))
        .route("/api/disagreements/{id}", delete(ask::take_back))
        .route("/api/retrain", get(ask::progress).post(ask::retrain))
        .route("/api/retrained.nfm", get(ask::retrained))
        .fallback(crate::server::api::nothing_here)
        .method_not_allowed_fallback(crate::server::api::wrong_method)
        .layer(from_fn_with_state(guard, guard::check))
        .layer(from_fn(guard::head))
        .with_state(app)
}
