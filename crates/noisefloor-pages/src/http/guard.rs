//! Checks of every request: that it means this server, and comes from its own pages.

use super::exposure::Exposure;
use super::reply::Refusal;
use axum::extract::{ConnectInfo, Request, State};
use axum::http::header::{CONTENT_TYPE, HOST, HeaderMap, HeaderName, HeaderValue, ORIGIN};
use axum::http::{Method, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::collections::{HashMap, HashSet};
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Only what the server itself sends may run, be shown, or be requested.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; \
    connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// Different wrong codes that one address may try in [`WINDOW`].
const WRONG_CODES: usize = 30;
const WINDOW: Duration = Duration::from_secs(60);
/// Sessions that one address may begin in [`WINDOW`]: a class behind one router, and no program.
const SESSIONS: usize = 60;
/// Most addresses that are counted.
const MOST_ADDRESSES: usize = 10_000;

/// Names of the server, and wrong codes by address.
#[derive(Debug)]
pub struct Guard {
    hosts: Vec<String>,
    /// Port at which any address of this machine is known, if the server listens on all of them.
    any_address: Option<u16>,
    exposure: Exposure,
    wrong: Counts<HashSet<String>>,
    begun: Counts<usize>,
}

/// What came from each address within [`WINDOW`].
#[derive(Debug, Default)]
struct Counts<T>(Mutex<HashMap<IpAddr, (Instant, T)>>);

impl<T: Default> Counts<T> {
    fn of<R>(&self, client: Client, count: impl FnOnce(&mut T) -> R) -> R {
        let mut counts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if counts.len() >= MOST_ADDRESSES {
            counts.retain(|_, (since, _)| since.elapsed() < WINDOW);
        }
        let begun = || (Instant::now(), T::default());
        let entry = counts.entry(client.0).or_insert_with(begun);
        if entry.0.elapsed() >= WINDOW {
            *entry = begun();
        }
        count(&mut entry.1)
    }
}

/// The address a request comes from: of the participant, if a trusted proxy passed it on.
#[derive(Clone, Copy, Debug)]
pub struct Client(IpAddr);

impl Guard {
    /// The guard of a server that listens on an address and is exposed like this.
    pub(super) fn new(address: SocketAddr, exposure: &Exposure) -> Self {
        Self {
            hosts: exposure.hosts(address),
            any_address: address.ip().is_unspecified().then(|| address.port()),
            exposure: exposure.clone(),
            wrong: Counts::default(),
            begun: Counts::default(),
        }
    }

    /// Whether the address is a proxy that is believed.
    pub(super) fn trusts(&self, peer: IpAddr) -> bool {
        self.exposure.proxies.contains(&peer)
    }

    /// A host, in lower case, if it is this server, with or without a port.
    fn known(&self, host: &str) -> Option<String> {
        let host = host.to_lowercase();
        let without_port = host.rsplit_once(':').filter(|(_, port)| port.parse::<u16>().is_ok());
        let name = without_port.map_or(&host[..], |(name, _)| name);
        // Browsers leave out the port that is usual
        let full = if without_port.is_some() { host.clone() } else { format!("{host}:80") };
        // A page elsewhere can make its name resolve to this machine, but an address is no name
        let of_machine =
            |host: &str| host.parse().is_ok_and(|at: SocketAddr| Some(at.port()) == self.any_address);
        (of_machine(&full) || self.hosts.iter().any(|h| *h == full || h == name)).then_some(host)
    }

    /// Where a request comes from, and the scheme of the page: a proxy that is trusted says both.
    fn origin_of(&self, peer: IpAddr, headers: &HeaderMap) -> (IpAddr, &'static str) {
        if !self.trusts(peer) {
            return (peer, "http");
        }
        let text = |name: &str| headers.get_all(name).iter().filter_map(|v| v.to_str().ok());
        // The last address that is no trusted proxy: those before it may be made up
        let hops: Vec<&str> = text("x-forwarded-for").flat_map(|v| v.split(',')).map(str::trim).collect();
        let hops = hops.iter().rev().filter_map(|hop| hop.parse::<IpAddr>().ok());
        let client = hops.into_iter().find(|hop| !self.trusts(*hop)).unwrap_or(peer);
        let secure = text("x-forwarded-proto").next_back().is_some_and(|v| v.trim() == "https");
        (client, if secure { "https" } else { "http" })
    }

    /// Counts a session without a link, which anybody can begin.
    pub fn begins(&self, client: Client) -> Result<(), Refusal> {
        let count = |begun: &mut usize| {
            *begun += 1;
            *begun
        };
        if self.begun.of(client, count) <= SESSIONS {
            return Ok(());
        }
        let what = format!("{SESSIONS} sessions were begun from this address within a minute");
        Err(Refusal::new(StatusCode::TOO_MANY_REQUESTS, what, "session", "wait a minute, and begin again"))
    }

    /// Counts a wrong code. After many different ones from an address, its guesses are refused for a
    /// while; requests with a valid code never get here.
    pub fn wrong_code(&self, client: Client, code: &str) -> Refusal {
        let count = |codes: &mut HashSet<String>| {
            let fits = codes.len() < WRONG_CODES;
            fits && {
                codes.insert(code.chars().take(16).collect());
                true
            }
        };
        if self.wrong.of(client, count) {
            return Refusal::unknown_code();
        }
        let what = format!("{WRONG_CODES} different wrong codes came from this address within a minute");
        Refusal::new(StatusCode::TOO_MANY_REQUESTS, what, "code", "wait a minute, and check the code")
    }
}

/// Refuses requests that mean another host, or come from another page.
pub(super) async fn check(
    State(guard): State<Arc<Guard>>,
    ConnectInfo(peer): ConnectInfo<SocketAddr>,
    mut request: Request,
    next: Next,
) -> Response {
    let (client, scheme) = guard.origin_of(peer.ip(), request.headers());
    if let Some(refusal) = foreign(&guard, scheme, &request) {
        return refusal.into_response();
    }
    request.extensions_mut().insert(Client(client));
    next.run(request).await
}

fn foreign(guard: &Guard, scheme: &str, request: &Request) -> Option<Refusal> {
    let headers = request.headers();
    let refuse = |status, what: &str, place: &str, do_: &str| Some(Refusal::new(status, what, place, do_));
    // Which of two counts would be a matter of who reads them (RFC 9112, §3.2)
    let twice = |name: &&str| headers.get_all(*name).iter().nth(1).is_some();
    if let Some(name) = ["Host", "Origin", "Sec-Fetch-Site", "Content-Type"].iter().find(|name| twice(name)) {
        return refuse(StatusCode::BAD_REQUEST, "the header is there twice", name, "send it once");
    }
    // Of a target with a host, that one counts, and not the header (RFC 9112, §3.2.2)
    let named = match request.uri().authority() {
        Some(authority) => Some(authority.as_str()),
        None => headers.get(HOST).and_then(|host| host.to_str().ok()),
    };
    let Some(host) = named.and_then(|host| guard.known(host)) else {
        let do_ = "open the address that `noisefloor` printed, or the machine's address if it listens on all; \
            `study serve` and `explore` take further names with --allow-host";
        let what = "this server does not go by that name";
        return refuse(StatusCode::MISDIRECTED_REQUEST, what, "Host", do_);
    };
    let origin = headers.get(ORIGIN).map(|o| o.to_str().unwrap_or_default().to_lowercase());
    let site = headers.get("sec-fetch-site").map(|s| s.to_str().unwrap_or_default());
    // Files of the pages are no secret: they load, and can say what is wrong with what they ask for
    let path = request.uri().path();
    let file = request.method() == Method::GET && !path.contains("/api/");
    let own = file || origin.is_none_or(|o| o == format!("{scheme}://{host}"));
    let page = format!("{}/", guard.exposure.base_path);
    let navigation = request.method() == Method::GET && page.starts_with(path);
    if !own || (matches!(site, Some("cross-site" | "same-site")) && !navigation) {
        let what = "the request comes from a page of another site";
        let do_ = "use the pages that this server sends; behind a proxy, start it with --trust-proxy";
        return refuse(StatusCode::FORBIDDEN, what, "Origin", do_);
    }
    let writes = !matches!(*request.method(), Method::GET | Method::HEAD | Method::DELETE);
    // Forms of other sites cannot send these types unasked
    let safe = ["application/json", "application/octet-stream"];
    let typed = headers
        .get(CONTENT_TYPE)
        .is_some_and(|t| safe.iter().any(|s| t.as_bytes().starts_with(s.as_bytes())));
    if writes && !typed {
        let what = "the body is declared neither as JSON nor as a picture";
        let do_ = "send JSON, with Content-Type: application/json";
        return refuse(StatusCode::UNSUPPORTED_MEDIA_TYPE, what, "Content-Type", do_);
    }
    None
}

/// Headers of every reply.
pub(super) async fn security_headers(request: Request, next: Next) -> Response {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(&'static str, &'static str)]) -> HeaderMap {
        pairs.iter().map(|(n, v)| (HeaderName::from_static(n), HeaderValue::from_static(v))).collect()
    }

    #[test]
    fn only_trusted_proxies_are_believed() {
        let proxy: IpAddr = [127, 0, 0, 1].into();
        let exposure = Exposure::named(&["Study.Example".into()]).trusting(&[proxy]);
        let guard = Guard::new(([127, 0, 0, 1], 8437).into(), &exposure);
        let forwarded = headers(&[
            ("x-forwarded-for", "1.1.1.1, 203.0.113.9, 127.0.0.1"),
            ("x-forwarded-proto", "https"),
        ]);
        assert_eq!(guard.origin_of(proxy, &forwarded), ([203, 0, 113, 9].into(), "https"));
        let stranger: IpAddr = [198, 51, 100, 7].into();
        assert_eq!(guard.origin_of(stranger, &forwarded), (stranger, "http"));
        assert_eq!(guard.origin_of(proxy, &headers(&[("x-forwarded-for", "nonsense")])), (proxy, "http"));
        for (host, known) in [
            ("study.example", true),
            ("study.example:8443", true),
            ("localhost:8437", true),
            ("localhost:80", false),
            ("evil.example", false),
        ] {
            assert_eq!(guard.known(host).is_some(), known, "{host}");
        }
    }

    /// Listening on all addresses, it goes by each of them, and by no name that it was not given.
    #[test]
    fn addresses_of_the_machine_are_known_where_it_listens_on_all() {
        let knows = |listening: [u8; 4], host: &str| {
            let guard = Guard::new((listening, 8437).into(), &Exposure::default());
            guard.known(host).is_some()
        };
        for (host, known) in [
            ("192.168.1.5:8437", true),
            ("[fe80::1]:8437", true),
            ("localhost:8437", true),
            ("192.168.1.5:80", false),
            ("192.168.1.5", false),
            ("evil.example:8437", false),
        ] {
            assert_eq!(knows([0, 0, 0, 0], host), known, "{host}");
        }
        assert!(!knows([127, 0, 0, 1], "192.168.1.5:8437"));
    }

    /// Browsers name no port where it is 80.
    #[test]
    fn the_usual_port_needs_no_name() {
        for (listening, host, known) in [
            ([127, 0, 0, 1], "localhost", true),
            ([127, 0, 0, 1], "[::1]", true),
            ([127, 0, 0, 1], "localhost:80", true),
            ([127, 0, 0, 1], "192.168.1.5", false),
            ([0, 0, 0, 0], "192.168.1.5", true),
            ([0, 0, 0, 0], "evil.example", false),
        ] {
            let guard = Guard::new((listening, 80).into(), &Exposure::default());
            assert_eq!(guard.known(host).is_some(), known, "{host}");
        }
    }

    /// `GET http://other.example/` with the right header means another server all the same.
    #[test]
    fn the_host_of_a_target_counts_before_the_header() {
        let guard = Guard::new(([127, 0, 0, 1], 8437).into(), &Exposure::default());
        for (target, host, known) in [
            ("/", "localhost:8437", true),
            ("http://localhost:8437/", "localhost:8437", true),
            ("http://localhost:8437/", "other.example", true),
            ("http://other.example/", "localhost:8437", false),
            ("http://localhost@other.example/", "localhost:8437", false),
        ] {
            let request = Request::builder().uri(target).header(HOST, host).body(Default::default()).unwrap();
            let refusal = foreign(&guard, "http", &request).map(|refusal| refusal.into_response().status());
            assert_eq!(refusal, (!known).then_some(StatusCode::MISDIRECTED_REQUEST), "{target} {host}");
        }
    }

    #[test]
    fn one_address_begins_few_sessions_a_minute() {
        let guard = Guard::new(([127, 0, 0, 1], 1).into(), &Exposure::default());
        let client = Client([203, 0, 113, 9].into());
        assert!((0..SESSIONS).all(|_| guard.begins(client).is_ok()));
        assert!(guard.begins(client).is_err());
        assert!(guard.begins(Client([203, 0, 113, 10].into())).is_ok());
    }

    #[test]
    fn repeating_one_wrong_code_locks_nobody_out() {
        let guard = Guard::new(([127, 0, 0, 1], 1).into(), &Exposure::default());
        let client = Client([203, 0, 113, 9].into());
        let refused = |code: &str| !guard.wrong_code(client, code).is_unknown_code();
        assert!(!(0..100).any(|_| refused("000000000000")));
        assert!(!(1..30).any(|i| refused(&format!("{i:012}"))));
        assert!(refused("ABCDEFGHJKMN"));
        assert!(guard.wrong_code(Client([203, 0, 113, 10].into()), "0").is_unknown_code());
    }
}
