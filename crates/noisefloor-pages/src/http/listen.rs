//! Connections: how many, for how long, and how they end.

use super::exposure::Exposure;
use super::guard::{Guard, check, security_headers};
use super::patience::Patient;
use super::reply::{nothing_here, wrong_method};
use crate::error::PagesError;
use axum::extract::ConnectInfo;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use std::collections::HashMap;
use std::future::Future;
use std::net::{IpAddr, SocketAddr};
use std::pin::pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;

/// How many connections there may be, and how long one may take.
#[derive(Clone, Copy, Debug)]
struct Limits {
    /// Most open connections; further ones wait in the queue of the operating system.
    connections: usize,
    /// Most of one address, which must not lock out the others. Further ones are closed.
    of_address: usize,
    /// Time for the headers of a request to arrive in full, and the longest pause between two requests of a
    /// connection.
    header_time: Duration,
    /// Time for a peer to take a share of a reply.
    write_time: Duration,
}

/// Below the usual limit of 1024 files; a laboratory of seventy behind one address has six for each browser.
const LIMITS: Limits = Limits {
    connections: 900,
    of_address: 450,
    header_time: Duration::from_secs(10),
    write_time: Duration::from_secs(30),
};
/// Time for requests under way to finish once the server is asked to stop.
const DRAIN_TIME: Duration = Duration::from_secs(3);
/// Pause after the operating system refused a connection, for example because too many files are open.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

#[derive(Debug)]
pub struct Listening {
    listener: TcpListener,
    address: SocketAddr,
    guard: Arc<Guard>,
    limits: Limits,
}

impl Listening {
    /// Binds an address; port 0 picks a free port. Proxies that are trusted may open as many connections as
    /// they like.
    pub async fn bind(address: SocketAddr, exposure: &Exposure) -> Result<Self, PagesError> {
        let failed = |source| PagesError::Listen { address: address.to_string(), source };
        let listener = TcpListener::bind(address).await.map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let guard = Arc::new(Guard::new(address, exposure));
        Ok(Self { listener, address, guard, limits: LIMITS })
    }

    /// What checks its requests.
    pub fn guard(&self) -> Arc<Guard> {
        Arc::clone(&self.guard)
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves until `stop` resolves, and checks every request. Requests under way then have three seconds to
    /// finish; idle and half-open connections are closed.
    ///
    /// By hand, over hyper: `axum::serve` has no times and no limits, and hyper none for a peer that never
    /// reads, or for all connections of an address.
    pub async fn serve(self, router: Router, stop: impl Future<Output = ()> + Send) {
        let router = router
            .fallback(nothing_here)
            .method_not_allowed_fallback(wrong_method)
            .layer(from_fn_with_state(self.guard(), check))
            .layer(from_fn(security_headers));
        let Limits { connections, of_address, .. } = self.limits;
        let (slots, places) = (Arc::new(Semaphore::new(connections)), Places::default());
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
                    // Proxies stand for many
                    let most = if self.guard.trusts(peer.ip()) { connections } else { of_address };
                    let Some(place) = places.take(peer.ip(), most) else { continue };
                    let connection = connection(stream, peer, self.limits, &router, &graceful);
                    tokio::spawn(async move {
                        connection.await;
                        drop((slot, place));
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

/// Open connections by address.
#[derive(Clone, Debug, Default)]
struct Places(Arc<Mutex<HashMap<IpAddr, usize>>>);

/// One connection of an address, as long as it lives.
struct Place {
    places: Places,
    address: IpAddr,
}

impl Places {
    fn lock(&self) -> MutexGuard<'_, HashMap<IpAddr, usize>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A place for one more connection of an address, if it has fewer than `most`.
    fn take(&self, address: IpAddr, most: usize) -> Option<Place> {
        let mut open = self.lock();
        let count = open.entry(address).or_default();
        if *count >= most {
            return None;
        }
        *count += 1;
        Some(Place { places: self.clone(), address })
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut open = self.places.lock();
        if let Some(count) = open.get_mut(&self.address) {
            *count -= 1;
            if *count == 0 {
                open.remove(&self.address);
            }
        }
    }
}

/// One connection, to its end. It is watched, so that a shutdown closes it after the request under way.
fn connection(
    stream: tokio::net::TcpStream,
    peer: SocketAddr,
    limits: Limits,
    router: &Router,
    graceful: &GracefulShutdown,
) -> impl Future<Output = ()> + use<> {
    // Answers are small and wait for nothing
    drop(stream.set_nodelay(true));
    let service = TowerToHyperService::new(router.clone().layer(Extension(ConnectInfo(peer))));
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(limits.header_time)
        .serve_connection(Patient::new(TokioIo::new(stream), limits.write_time), service);
    let watched = graceful.watch(served);
    async move {
        // A peer that hangs up or is too slow is not an error of the server
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

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::Bytes;
    use axum::routing::get;
    use std::io::{Read, Write};
    use std::net::TcpStream;
    use std::thread::sleep;
    use tokio::net::TcpSocket;
    use tokio::runtime::{Builder, Runtime};

    /// More than the buffers of two sockets hold.
    const LARGE: usize = 64 << 20;
    const LOCAL: [u8; 4] = [127, 0, 0, 1];

    /// Serves a small and a large reply with these limits.
    struct Served {
        runtime: Runtime,
        address: SocketAddr,
    }

    impl Served {
        fn within(limits: Limits) -> Self {
            let runtime = Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
            let exposure = Exposure::named(&["x".to_owned()]);
            let listening = Listening::bind((LOCAL, 0).into(), &exposure);
            let listening = Listening { limits, ..runtime.block_on(listening).unwrap() };
            let (address, large) = (listening.address(), Bytes::from(vec![b'.'; LARGE]));
            let router = Router::new()
                .route("/", get(async || "small"))
                .route("/large", get(move || std::future::ready(large.clone())));
            runtime.spawn(listening.serve(router, std::future::pending()));
            Self { runtime, address }
        }

        /// Sends a request from this address.
        fn ask(&self, from: [u8; 4], path: &str) -> TcpStream {
            let connect = async {
                let socket = TcpSocket::new_v4().unwrap();
                socket.bind((from, 0).into()).unwrap();
                socket.connect(self.address).await.unwrap().into_std().unwrap()
            };
            let mut stream = self.runtime.block_on(connect);
            stream.set_nonblocking(false).unwrap();
            stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
            // The server may close it at once
            drop(stream.write_all(format!("GET {path} HTTP/1.1\r\nHost: x\r\n\r\n").as_bytes()));
            stream
        }
    }

    /// Whether a reply comes within ten seconds.
    fn is_answered(mut stream: TcpStream) -> bool {
        let mut reply = [0; 12];
        stream.read_exact(&mut reply).is_ok() && reply.ends_with(b"200")
    }

    /// Two who ask and never read hold both connections, and only for the time allowed.
    #[test]
    fn who_never_reads_is_dropped() {
        let write_time = Duration::from_millis(500);
        let served = Served::within(Limits { connections: 2, of_address: 2, write_time, ..LIMITS });
        let [mut stuck, other] = [0; 2].map(|_| served.ask(LOCAL, "/large"));
        sleep(Duration::from_millis(100));
        assert!(is_answered(served.ask(LOCAL, "/")));
        // One of the two was dropped; let the time of the other one, which may be this, be over, too. What is
        // left of the reply never comes
        sleep(2 * write_time);
        let mut got = Vec::new();
        drop(stuck.read_to_end(&mut got));
        assert!(got.len() < LARGE, "{}", got.len());
        drop(other);
    }

    #[test]
    fn half_a_header_is_closed_in_time() {
        let served = Served::within(Limits { header_time: Duration::from_millis(200), ..LIMITS });
        let mut slow = TcpStream::connect(served.address).unwrap();
        slow.write_all(b"GET / HTTP/1.1\r\nhost: ").unwrap();
        slow.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        slow.read_to_end(&mut Vec::new()).unwrap();
    }

    /// Who reads slowly, and pauses between requests for longer than the time allowed, gets everything.
    #[test]
    fn who_reads_slowly_is_served() {
        let write_time = Duration::from_millis(300);
        let served = Served::within(Limits { connections: 2, of_address: 2, write_time, ..LIMITS });
        let mut slow = served.ask(LOCAL, "/large");
        let (mut got, mut part) = (0, vec![0; 1 << 20]);
        while got < LARGE {
            let read = slow.read(&mut part).unwrap();
            assert!(read > 0, "closed after {got} bytes");
            got += read;
            sleep(Duration::from_millis(10));
        }
        sleep(2 * write_time);
        slow.write_all(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n").unwrap();
        let mut rest = Vec::new();
        while !rest.ends_with(b"small") {
            let read = slow.read(&mut part).unwrap();
            assert!(read > 0, "closed after {rest:?}");
            rest.extend_from_slice(&part[..read]);
        }
    }

    /// One address cannot take all connections.
    #[test]
    #[cfg(target_os = "linux")]
    fn one_address_leaves_room_for_others() {
        let write_time = Duration::from_secs(60);
        let served = Served::within(Limits { connections: 4, of_address: 2, write_time, ..LIMITS });
        let greedy = [127, 0, 0, 2];
        let ask = |_| {
            sleep(Duration::from_millis(50));
            served.ask(greedy, "/large")
        };
        let held = [0; 4].map(ask);
        assert!(is_answered(served.ask([127, 0, 0, 3], "/")));
        assert!(!is_answered(served.ask(greedy, "/")));
        // A place is free again once its connection has ended
        drop(held);
        sleep(Duration::from_millis(500));
        assert!(is_answered(served.ask(greedy, "/")));
    }
}
