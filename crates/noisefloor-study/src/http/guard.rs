//! What every request is checked for before anything looks at it: that it means this server, and comes from
//! its own pages.

use super::reply::Refusal;
use axum::extract::{ConnectInfo, Request, State};
use axum::http::header::{CONTENT_TYPE, HOST, HeaderName, HeaderValue, ORIGIN};
use axum::http::{Method, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Nothing but what the server itself sends may run, be shown or be asked.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; \
    connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// Wrong codes that one address may try in [`WINDOW`].
const WRONG_CODES: u32 = 30;
const WINDOW: Duration = Duration::from_secs(60);
/// Addresses whose errors are counted.
const MOST_ADDRESSES: usize = 10_000;

/// Names that the server goes by, and errors by address.
pub(crate) struct Guard {
    /// Lower case, with port.
    hosts: Vec<String>,
    wrong: Mutex<HashMap<IpAddr, (Instant, u32)>>,
}

impl Guard {
    pub(crate) fn new(address: SocketAddr, names: &[String]) -> Self {
        let port = address.port();
        let mut hosts = vec![address.to_string()];
        if address.ip().is_loopback() || address.ip().is_unspecified() {
            hosts.extend(["127.0.0.1", "localhost", "[::1]"].map(|name| format!("{name}:{port}")));
        }
        for name in names {
            let has_port = name.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
            hosts.push(if has_port {
                name.to_lowercase()
            } else {
                format!("{}:{port}", name.to_lowercase())
            });
        }
        Self { hosts, wrong: Mutex::default() }
    }

    /// The Host header names this server. (A page elsewhere whose name was made to resolve to this machine
    /// sends its own.)
    fn knows(&self, host: Option<&HeaderValue>) -> Option<String> {
        let host = host?.to_str().ok()?.to_lowercase();
        self.hosts.contains(&host).then_some(host)
    }

    /// Counts a wrong code.
    pub(crate) fn count(&self, address: IpAddr) {
        let mut wrong = self.wrong.lock().unwrap_or_else(PoisonError::into_inner);
        if wrong.len() >= MOST_ADDRESSES {
            wrong.retain(|_, (since, _)| since.elapsed() < WINDOW);
        }
        let entry = wrong.entry(address).or_insert((Instant::now(), 0));
        if entry.0.elapsed() >= WINDOW {
            *entry = (Instant::now(), 0);
        }
        entry.1 += 1;
    }

    /// Whether an address has to wait.
    pub(crate) fn is_tired_of(&self, address: IpAddr) -> bool {
        let wrong = self.wrong.lock().unwrap_or_else(PoisonError::into_inner);
        wrong.get(&address).is_some_and(|(since, n)| since.elapsed() < WINDOW && *n >= WRONG_CODES)
    }
}

/// Refuses requests that mean another host, or come from another page.
pub(crate) async fn check(
    State(guard): State<Arc<Guard>>,
    ConnectInfo(peer): ConnectInfo<SocketAddr>,
    request: Request,
    next: Next,
) -> Response {
    match foreign(&guard, peer.ip(), &request) {
        Some(refusal) => refusal.into_response(),
        None => next.run(request).await,
    }
}

fn foreign(guard: &Guard, peer: IpAddr, request: &Request) -> Option<Refusal> {
    let headers = request.headers();
    let Some(host) = guard.knows(headers.get(HOST)) else {
        let do_ = "open the address that `noisefloor` printed, or name this host with --allow-host";
        return Some(Refusal::new(
            StatusCode::MISDIRECTED_REQUEST,
            "this server does not go by that name",
            "Host",
            do_,
        ));
    };
    let origin = headers.get(ORIGIN).map(|o| o.to_str().unwrap_or_default().to_lowercase());
    let site = headers.get("sec-fetch-site").map(|s| s.to_str().unwrap_or_default());
    let own = origin.is_none_or(|o| o == format!("http://{host}"));
    let navigation = request.method() == Method::GET && request.uri().path() == "/";
    if !own || (matches!(site, Some("cross-site" | "same-site")) && !navigation) {
        let what = "the request comes from a page of another site";
        return Some(Refusal::new(
            StatusCode::FORBIDDEN,
            what,
            "Origin",
            "use the pages that this server sends",
        ));
    }
    let writes = !matches!(*request.method(), Method::GET | Method::HEAD);
    // Forms of other sites cannot send these types without being asked first
    let safe = ["application/json", "application/octet-stream"];
    let typed = headers
        .get(CONTENT_TYPE)
        .is_some_and(|t| safe.iter().any(|s| t.as_bytes().starts_with(s.as_bytes())));
    if writes && request.method() != Method::DELETE && !typed {
        let do_ = "send JSON, with Content-Type: application/json";
        return Some(Refusal::new(
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            "the body is declared neither as JSON nor as a picture",
            "Content-Type",
            do_,
        ));
    }
    if guard.is_tired_of(peer) && request.uri().path().starts_with("/api/sessions/") {
        let what = format!("more than {WRONG_CODES} wrong codes in a minute came from this address");
        return Some(Refusal::new(
            StatusCode::TOO_MANY_REQUESTS,
            what,
            "code",
            "wait a minute, and check the code",
        ));
    }
    None
}

/// Headers of every answer.
pub(crate) async fn security_headers(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    for (name, value) in [
        ("content-security-policy", POLICY),
        ("x-content-type-options", "nosniff"),
        ("referrer-policy", "no-referrer"),
        ("cross-origin-opener-policy", "same-origin"),
        ("cross-origin-resource-policy", "same-origin"),
        ("permissions-policy", "camera=(), geolocation=(), microphone=()"),
    ] {
        headers.insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    headers.entry("cache-control").or_insert(HeaderValue::from_static("no-store"));
    response
}
