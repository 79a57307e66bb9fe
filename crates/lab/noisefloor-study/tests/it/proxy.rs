use crate::browser;
use crate::kit::Running;
use noisefloor_pages::http::Exposure;
use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// A proxy with TLS in front of two servers, until it is dropped.
struct Proxy {
    child: Child,
    url: String,
}

impl Drop for Proxy {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// A certificate for localhost, in a folder.
fn certify(folder: &Path) {
    let made = Command::new("openssl")
        .args(["req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost"])
        .args(["-addext", "subjectAltName=DNS:localhost", "-keyout", "key.pem", "-out", "cert.pem"])
        .current_dir(folder)
        .stderr(Stdio::null())
        .status()
        .unwrap();
    assert!(made.success(), "openssl makes a certificate");
}

/// Starts a proxy by its configuration in this folder: `kept` gets the path as it is, `stripped` without its
/// first part.
fn start(program: &str, folder: &Path, kept: &Running, stripped: &Running) -> Proxy {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let (name, arguments): (_, &[&str]) = match program {
        "nginx" => ("nginx.conf", &["-c"]),
        _ => ("Caddyfile", &["run", "--adapter", "caddyfile", "--config"]),
    };
    let folder = folder.join(format!("{program}-{port}"));
    fs::create_dir(&folder).unwrap();
    certify(&folder);
    let written = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/it").join(name);
    let text = fs::read_to_string(written)
        .unwrap()
        .replace("FOLDER", folder.to_str().unwrap())
        .replace("PORT", &port.to_string())
        .replace("KEPT", &kept.address.port().to_string())
        .replace("STRIPPED", &stripped.address.port().to_string());
    let file = folder.join(name);
    fs::write(&file, text).unwrap();
    let log = fs::File::create(folder.join("error.log")).unwrap();
    let child = Command::new(program)
        .args(arguments)
        .arg(&file)
        .env("HOME", &folder)
        .stdout(Stdio::null())
        .stderr(log)
        .spawn()
        .unwrap();
    let proxy = Proxy { child, url: format!("https://localhost:{port}") };
    for _ in 0..200 {
        if std::net::TcpStream::connect(("127.0.0.1", port)).is_ok() {
            return proxy;
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    let said = fs::read_to_string(folder.join("error.log")).unwrap_or_default();
    panic!("{program} does not listen: {said}");
}

/// Participants behind nginx and Caddy with TLS, under a path that is passed on and under one that is
/// stripped; and what a server refuses that is not told to trust the proxy.
#[test]
fn a_study_works_behind_proxies() {
    if browser::browser(&["nginx", "caddy", "openssl"]).is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let studies = [0, 1, 2].map(|_| browser::study("validation", "", ""));
    let named = Exposure::named(&["localhost".into()]);
    let trusting = named.clone().trusting(&[[127, 0, 0, 1].into()]);
    let kept = Running::exposed(studies[0].1.clone(), trusting.clone().under("/noise"));
    let stripped = Running::exposed(studies[1].1.clone(), trusting);
    // Its pages look like those of another site
    let untrusting = Running::exposed(studies[2].1.clone(), named.under("/noise"));
    let proxies = ["nginx", "caddy"].map(|program| start(program, folder.path(), &kept, &stripped));
    let untrusted = start("nginx", folder.path(), &untrusting, &stripped);
    let urls = serde_json::json!({ "nginx": proxies[0].url, "Caddy": proxies[1].url }).to_string();
    browser::run("proxy.test.mjs", &[("PROXIES", &urls), ("UNTRUSTED", &untrusted.url)]);
}
