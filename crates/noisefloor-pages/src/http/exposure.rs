//! Under which names, and behind which proxies, a server may be reached.

use std::net::{IpAddr, SocketAddr};

/// How a server is exposed beyond its own address. The default exposes nothing more.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Exposure {
    /// Further host names, `host` (at any port) or `host:port`. A page elsewhere whose name was made to
    /// resolve to this machine sends its own name, and is turned away.
    pub names: Vec<String>,
    /// Addresses of proxies whose `X-Forwarded-For` and `X-Forwarded-Proto` are believed.
    pub proxies: Vec<IpAddr>,
    /// Path under which the proxy passes requests on without stripping it, for example `/noise`; empty for
    /// none.
    pub base_path: String,
}

impl Exposure {
    /// Exposed under further names.
    pub fn named(names: &[String]) -> Self {
        Self { names: names.to_vec(), ..Self::default() }
    }

    /// Believes proxies at these addresses.
    #[must_use]
    pub fn trusting(mut self, proxies: &[IpAddr]) -> Self {
        self.proxies = proxies.to_vec();
        self
    }

    /// Served under a path: `noise` and `/noise/` mean `/noise`.
    #[must_use]
    pub fn under(mut self, path: &str) -> Self {
        let path = path.trim_matches('/');
        self.base_path = if path.is_empty() { String::new() } else { format!("/{path}") };
        self
    }

    /// Host headers that name this server, in lower case.
    pub(super) fn hosts(&self, address: SocketAddr) -> Vec<String> {
        let port = address.port();
        let mut hosts = vec![address.to_string()];
        if address.ip().is_loopback() || address.ip().is_unspecified() {
            hosts.extend(["127.0.0.1", "localhost", "[::1]"].map(|name| format!("{name}:{port}")));
        }
        hosts.extend(self.names.iter().map(|name| name.to_lowercase()));
        hosts
    }
}
