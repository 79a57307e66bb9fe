//! Connections: how many, for how long, and how they end.

use crate::error::StudyError;
use axum::extract::ConnectInfo;
use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use std::future::Future;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;

/// Most open connections; further ones wait in the queue of the operating system. Below the usual limit of
/// 1024 files.
const MOST_CONNECTIONS: usize = 900;
/// Time for the headers of a request to arrive in full, and the longest pause between two requests of a
/// connection.
const HEADER_TIME: Duration = Duration::from_secs(10);
/// Time for requests under way to finish once the server is asked to stop.
const DRAIN_TIME: Duration = Duration::from_secs(3);
/// Pause after the operating system refused a connection, for example because too many files are open.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// A bound address.
#[derive(Debug)]
pub(crate) struct Listening {
    listener: TcpListener,
    address: SocketAddr,
}

impl Listening {
    /// Binds an address; port 0 picks a free port.
    ///
    /// # Errors
    /// [`StudyError::Listen`] if the address is in use or not of this machine.
    pub(crate) async fn bind(address: SocketAddr) -> Result<Self, StudyError> {
        let failed = |source| StudyError::Listen { address: address.to_string(), source };
        let listener = TcpListener::bind(address).await.map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        Ok(Self { listener, address })
    }

    /// The bound address.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves until `stop` resolves. Requests under way then have [`DRAIN_TIME`] to finish; idle and
    /// half-open connections are closed.
    pub(crate) async fn serve(self, router: Router, stop: impl Future<Output = ()> + Send) {
        let slots = Arc::new(Semaphore::new(MOST_CONNECTIONS));
        let graceful = GracefulShutdown::new();
        let mut stop = pin!(stop);
        loop {
            let next = async {
                let slot = slots.clone().acquire_owned().await;
                (slot, self.listener.accept().await)
            };
            let (slot, accepted) = tokio::select! {
                () = &mut stop => break,
                next = next => next,
            };
            match (slot, accepted) {
                (Ok(slot), Ok((stream, peer))) => {
                    let connection = connection(stream, peer, &router, &graceful);
                    tokio::spawn(async move {
                        connection.await;
                        drop(slot);
                    });
                }
                _ => tokio::time::sleep(ACCEPT_PAUSE).await,
            }
        }
        drop(self.listener);
        // What is left after this time is cut off when the runtime ends
        drop(tokio::time::timeout(DRAIN_TIME, graceful.shutdown()).await);
    }
}

/// One connection, to its end. It is watched, so that a shutdown closes it after the request under way.
fn connection(
    stream: TcpStream,
    peer: SocketAddr,
    router: &Router,
    graceful: &GracefulShutdown,
) -> impl Future<Output = ()> + use<> {
    // Answers are small and wait for nothing
    drop(stream.set_nodelay(true));
    let service = TowerToHyperService::new(router.clone().layer(Extension(ConnectInfo(peer))));
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEADER_TIME)
        .serve_connection(TokioIo::new(stream), service);
    let watched = graceful.watch(served);
    async move {
        // A peer that breaks off or is too slow is no error of the server
        drop(watched.await);
    }
}

/// Resolves at the first Ctrl-C or SIGTERM. A second Ctrl-C ends the process at once, with status 130.
pub async fn interrupted() {
    first_signal().await;
    tokio::spawn(async {
        first_signal().await;
        std::process::exit(130);
    });
}

#[cfg(unix)]
async fn first_signal() {
    use tokio::signal::unix::{SignalKind, signal};
    let Ok(mut terminate) = signal(SignalKind::terminate()) else {
        return drop(tokio::signal::ctrl_c().await);
    };
    tokio::select! {
        _ = tokio::signal::ctrl_c() => (),
        _ = terminate.recv() => (),
    }
}

#[cfg(not(unix))]
async fn first_signal() {
    drop(tokio::signal::ctrl_c().await);
}
