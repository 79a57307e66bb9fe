use crate::browser;
use crate::kit::Running;
use noisefloor_study::Exposure;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// nginx, until it is dropped.
struct Nginx(Child);

impl Drop for Nginx {
    fn drop(&mut self) {
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

/// Starts nginx with TLS in front of two servers; its port.
fn nginx(folder: &Path, kept: u16, stripped: u16) -> (Nginx, u16) {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let made = Command::new("openssl")
        .args(["req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost"])
        .args(["-keyout", "key.pem", "-out", "cert.pem"])
        .current_dir(folder)
        .stderr(Stdio::null())
        .status()
        .unwrap();
    assert!(made.success(), "openssl makes a certificate");
    let text = include_str!("nginx.conf")
        .replace("FOLDER", folder.to_str().unwrap())
        .replace("PORT", &port.to_string())
        .replace("KEPT", &kept.to_string())
        .replace("STRIPPED", &stripped.to_string());
    let file = folder.join("nginx.conf");
    std::fs::write(&file, text).unwrap();
    let child = Command::new("nginx")
        .arg("-c")
        .arg(&file)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let nginx = Nginx(child);
    for _ in 0..100 {
        if std::net::TcpStream::connect(("127.0.0.1", port)).is_ok() {
            return (nginx, port);
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    panic!(
        "nginx does not listen: {}",
        std::fs::read_to_string(folder.join("error.log")).unwrap_or_default()
    );
}

/// A participant behind nginx with TLS, under a path that is passed on and under one that is stripped; and
/// what the server refuses that is not told to trust the proxy.
#[test]
fn a_study_works_behind_nginx() {
    if browser::browser(&["nginx", "openssl"]).is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let studies = [0, 1].map(|_| browser::study("validation", "", ""));
    let exposure = Exposure::named(&["localhost".into()]).trusting(&[[127, 0, 0, 1].into()]);
    let kept = Running::exposed(studies[0].1.clone(), exposure.clone().under("/noise"));
    let stripped = Running::exposed(studies[1].1.clone(), exposure);
    let (_nginx, port) = nginx(folder.path(), kept.address.port(), stripped.address.port());
    browser::run("proxy.test.mjs", &[("PROXY", &format!("https://localhost:{port}"))]);

    // Without trust in the proxy, its pages are those of another site
    drop(kept);
    let named = Exposure::named(&["localhost".into()]).under("/noise");
    let kept = Running::exposed(studies[0].1.clone(), named);
    let (_nginx, port) = nginx(folder.path(), kept.address.port(), stripped.address.port());
    browser::run("untrusted.test.mjs", &[("PROXY", &format!("https://localhost:{port}"))]);
}
