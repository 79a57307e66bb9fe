//! The server: pages, pictures and events over HTTP, for this machine alone unless it is told otherwise.

pub(crate) mod api;
pub(crate) mod guard;
mod pages;
pub(crate) mod reply;
mod tiles;

pub use api::{Beginning, SessionView, StackView, StudyView};

use crate::config::Study;
use crate::error::{StoreError, StudyError};
use crate::event::Envelope;
use crate::questplus::Grid;
use crate::session::{self, Session};
use crate::store::{Record, Store};
use axum::Router;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::{get, post};
use reply::Refusal;
use std::collections::HashMap;
use std::future::Future;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use tiles::TileCache;
use tokio::net::TcpListener;

/// Sessions that are kept in memory; others are read again from the database when they go on.
const MOST_LIVE: usize = 1000;

/// A session in memory; `None` until it has been read from the database.
type Live = Arc<tokio::sync::Mutex<Option<Session>>>;

/// Everything that requests share.
pub(crate) struct App {
    study: Arc<Study>,
    grids: Arc<Vec<Arc<Grid>>>,
    store: Store,
    live: Mutex<HashMap<String, Live>>,
    tiles: TileCache,
    guard: Arc<guard::Guard>,
}

/// A server that listens, and is yet to be run.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    router: Router,
    address: SocketAddr,
}

impl Server {
    /// Opens the answers of a study and listens. `address` with port 0 takes a free port. Requests have to name the server as `address`, as
    /// `localhost`, or as one of `names` (host or host:port): a page elsewhere that has its own name resolve to this machine is turned away.
    ///
    /// # Errors
    /// [`StudyError`] if the answers cannot be opened, or the address is taken.
    pub async fn bind(study: Arc<Study>, address: SocketAddr, names: &[String]) -> Result<Self, StudyError> {
        let store = Store::open(&study.database, &study.design())?;
        let failed = |source| StudyError::Listen { address: address.to_string(), source };
        let listener = TcpListener::bind(address).await.map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let app = Arc::new(App {
            grids: session::grids(&study),
            tiles: TileCache::new(study.clone()),
            guard: Arc::new(guard::Guard::new(address, names)),
            live: Mutex::default(),
            store,
            study,
        });
        Ok(Self { listener, router: router(app), address })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves until `stop` is ready, and answers what has come until then.
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
        .fallback(api::nothing_here)
        .method_not_allowed_fallback(api::wrong_method)
        .layer(from_fn_with_state(app.guard.clone(), guard::check))
        .layer(from_fn(guard::head))
        .with_state(app)
}

impl App {
    /// The place of a session in memory, which is empty at first. A code that is in no database is not remembered.
    fn place(&self, code: &str) -> Live {
        let mut live = self.live.lock().unwrap_or_else(PoisonError::into_inner);
        if live.len() >= MOST_LIVE {
            // Nobody holds those that only the map knows
            live.retain(|_, session| Arc::strong_count(session) > 1);
        }
        live.entry(code.to_owned()).or_default().clone()
    }

    fn forget(&self, code: &str) {
        self.live.lock().unwrap_or_else(PoisonError::into_inner).remove(code);
    }

    /// A session as its events left it.
    async fn load(&self, code: &str) -> Result<Session, StoreError> {
        let record = self.store.load(code).await?;
        // Replaying forced choices takes a tenth of a second
        let (study, grids) = (self.study.clone(), self.grids.clone());
        let replayed = tokio::task::spawn_blocking(move || replay(study, grids, &record)).await;
        replayed.map_err(|_| StoreError::Closed)?
    }

    /// Runs `with` on a session, which nobody else changes meanwhile.
    async fn with<T>(&self, code: &str, with: impl FnOnce(&Session) -> T) -> Result<T, Refusal> {
        let place = self.place(code);
        let mut live = place.lock().await;
        if live.is_none() {
            match self.load(code).await {
                Ok(session) => *live = Some(session),
                Err(error) => {
                    self.forget(code);
                    return Err(error.into());
                }
            }
        }
        live.as_ref().map(with).ok_or_else(|| StoreError::Closed.into())
    }

    /// Takes an event: checks it, keeps it, and only then lets it count. An event that is there already is acknowledged again.
    async fn record(&self, code: &str, envelope: Envelope) -> Result<Session, Refusal> {
        let place = self.place(code);
        let mut live = place.lock().await;
        let now = match live.take() {
            Some(session) => session,
            None => match self.load(code).await {
                Ok(session) => session,
                Err(error) => {
                    self.forget(code);
                    return Err(error.into());
                }
            },
        };
        let seq = envelope.seq;
        if seq < now.events() {
            let there = self.store.event(code, seq).await;
            let same = matches!(&there, Ok(Some(there)) if *there == envelope);
            let next = now.events();
            let session = live.insert(now);
            return match there {
                Err(error) => Err(error.into()),
                Ok(_) if same => Ok(session.clone()),
                Ok(_) => Err(Refusal::conflict(seq, next)),
            };
        }
        if seq > now.events() {
            let next = now.events();
            *live = Some(now);
            return Err(Refusal::conflict(seq, next));
        }
        let mut after = now.clone();
        if let Err(misfit) = after.apply(&envelope.event) {
            let next = now.events();
            *live = Some(now);
            return Err(Refusal::misfit(&misfit, next));
        }
        if let Err(error) = self.store.append(code, envelope).await {
            // What is on disk is not known: it is read again next time
            self.forget(code);
            return Err(error.into());
        }
        Ok(live.insert(after).clone())
    }
}

/// Replays a session from the database.
///
/// # Errors
/// [`StoreError::Event`] if an event does not fit.
pub fn replay(study: Arc<Study>, grids: Arc<Vec<Arc<Grid>>>, record: &Record) -> Result<Session, StoreError> {
    let mut session = Session::new(study, grids, record.seed);
    for (seq, envelope) in record.events.iter().enumerate() {
        let misfit = |what: String| StoreError::Event { code: record.code.clone(), seq: seq as u64, what };
        if envelope.seq != seq as u64 {
            return Err(misfit("its number leaves a gap".to_owned()));
        }
        session.apply(&envelope.event).map_err(|e| misfit(e.to_string()))?;
    }
    Ok(session)
}
