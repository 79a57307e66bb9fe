use crate::kit::{Folder, Running, levels};
use noisefloor_testkit::HANG;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Instant;

fn served() -> (Folder, Running) {
    let folder = Folder::new("acquisition", &["wall"], &levels(6, 2.0), "");
    let server = Running::start(folder.study());
    (folder, server)
}

/// Half a header keeps neither a connection nor the server: it is closed in time, and the server ends without
/// it.
#[test]
fn half_sent_headers_hold_nothing() {
    let (_folder, server) = served();
    let half = |text: &str| {
        let mut stream = TcpStream::connect(server.address).unwrap();
        stream.write_all(text.as_bytes()).unwrap();
        stream.set_read_timeout(Some(HANG)).unwrap();
        stream
    };
    let mut slow = half("GET / HTTP/1.1\r\nhost: ");
    let (begun, mut said) = (Instant::now(), Vec::new());
    drop(slow.read_to_end(&mut said));
    assert!(begun.elapsed() < HANG, "closed after {:?}", begun.elapsed());

    let held: Vec<TcpStream> = (0..20).map(|_| half("POST /api/sessions HTTP/1.1\r\nhost")).collect();
    let begun = Instant::now();
    drop(server);
    assert!(begun.elapsed() < HANG, "ended after {:?}", begun.elapsed());
    drop(held);
}

/// More connections than the server takes: the others wait, and are served once these are closed.
#[test]
fn connections_are_bounded_and_recover() {
    let (_folder, server) = served();
    let held: Vec<TcpStream> = (0..300).filter_map(|_| TcpStream::connect(server.address).ok()).collect();
    assert!(held.len() > 250, "{}", held.len());
    let mut stream = TcpStream::connect(server.address).unwrap();
    stream.set_read_timeout(Some(HANG)).unwrap();
    let request = format!("GET /api/study HTTP/1.1\r\nhost: {}\r\nconnection: close\r\n\r\n", server.address);
    stream.write_all(request.as_bytes()).unwrap();
    let mut said = String::new();
    stream.read_to_string(&mut said).unwrap();
    assert!(said.starts_with("HTTP/1.1 200"), "{said}");
}
