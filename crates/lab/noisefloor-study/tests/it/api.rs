use crate::kit::{Folder, JSON, Running, levels, public, refused};
use noisefloor_study::simulated::drive;
use noisefloor_testkit::HANG;
use serde_json::{Value, json};
use std::io::Write;
use std::net::TcpStream;
use std::time::Instant;

fn served() -> (Folder, Running) {
    let folder = Folder::new("acquisition", &["wall"], &levels(6, 2.0), "groups = [\"a\", \"b\"]");
    let server = Running::start(folder.study());
    (folder, server)
}

/// A session that is at its first trial; its code.
fn session(server: &Running) -> String {
    let (status, view) = server.post("/api/sessions", &json!({ "group": "a" }));
    assert_eq!(status, 201, "{view}");
    let code = view["code"].as_str().unwrap().to_owned();
    for (seq, event) in public(1, &[1.0, 1.0]).draw(0).arrive("en", &[]).iter().enumerate() {
        let event = json!({ "seq": seq, "at": 1000, "event": event });
        assert_eq!(server.post(&format!("/api/sessions/{code}/events"), &event).0, 200);
    }
    code
}

fn step(server: &Running, code: &str, seq: u64, level: u32) -> (u16, Value) {
    let event = json!({ "kind": "step", "trial": 0, "tile": 0, "level": level, "ms": 900 });
    server.post(&format!("/api/sessions/{code}/events"), &json!({ "seq": seq, "at": 1, "event": event }))
}

#[test]
fn pages_and_tiles_are_served_under_a_strict_policy() {
    let (_folder, server) = served();
    for (path, kind) in [
        ("/", "text/html"),
        ("/app.js", "text/javascript"),
        ("/style.css", "text/css"),
        ("/experimenter.html", "text/html"),
        ("/api/texts/en", "application/json"),
        ("/api/study", "application/json"),
        ("/api/tiles/0/5/1.png", "image/png"),
    ] {
        let (status, head, _) = server.raw("GET", path, "", b"");
        assert_eq!(status, 200, "{path}");
        assert!(head.contains(&format!("content-type: {kind}")), "{path}: {head}");
        assert!(head.contains("content-security-policy: default-src 'none'; script-src 'self'"));
        assert!(head.contains("x-content-type-options: nosniff"));
    }
    let page = String::from_utf8(server.raw("GET", "/", "", b"").2).unwrap();
    assert!(!page.contains("http:") && !page.contains("https:"), "the page names another machine");
    for path in [
        "/api/tiles/0/6/0.png",
        "/api/tiles/1/0/0.png",
        "/api/tiles/0/0/2.png",
        "/api/tiles/0/0/1.1.png",
        "/api/tiles/0/0/1.x.png",
        "/api/tiles/0/0/0",
        "/api/tiles/-1/0/0.png",
        "/api/tiles/%ff/0/0.png",
        "/study.toml",
        "/../study.toml",
        "/api/nothing",
    ] {
        refused(server.ask("GET", path, "", b""), 404);
    }
    refused(server.put("/api/study", &json!({})), 405);
}

#[test]
fn requests_of_other_sites_and_hosts_are_refused() {
    let (_folder, server) = served();
    let begin = |headers: &str| server.ask("POST", "/api/sessions", headers, br#"{"group":"a"}"#);
    assert_eq!(begin(&format!("origin: {}\r\n{JSON}", server.url)).0, 201);
    for (headers, status) in [
        ("host: evil.example\r\n".to_owned(), 421),
        (format!("host: evil.example:{}\r\n", server.address.port()), 421),
        ("origin: http://evil.example\r\n".to_owned(), 403),
        ("origin: null\r\n".to_owned(), 403),
        ("sec-fetch-site: cross-site\r\n".to_owned(), 403),
        ("sec-fetch-site: same-site\r\n".to_owned(), 403),
    ] {
        refused(begin(&format!("{headers}{JSON}")), status);
        refused(server.ask("GET", "/api/study", &headers, b""), status);
    }
    // What a form of another site could send without asking
    refused(begin("content-type: text/plain\r\n"), 415);
    refused(begin(""), 415);
    let local = format!("host: localhost:{}\r\n", server.address.port());
    assert_eq!(server.raw("GET", "/", &local, b"").0, 200);
}

#[test]
fn malformed_and_oversized_requests_are_refused() {
    let (_folder, server) = served();
    let code = session(&server);
    let events = format!("/api/sessions/{code}/events");
    for body in [
        "",
        "{",
        "[]",
        "null",
        r#"{"seq":2}"#,
        r#"{"seq":-1,"at":0,"event":{"kind":"pause"}}"#,
        r#"{"seq":2.5,"at":0,"event":{"kind":"pause"}}"#,
        r#"{"seq":2,"at":0,"event":{"kind":"shout"}}"#,
        r#"{"seq":2,"at":0,"event":{"kind":"consent","language":"en","more":1}}"#,
        r#"{"seq":2,"at":0,"extra":1,"event":{"kind":"pause"}}"#,
        r#"{"seq":2,"at":0,"event":{"kind":"step","trial":0,"tile":0,"level":99999999999,"ms":9}}"#,
        "\u{0}\u{1}",
    ] {
        refused(server.ask("POST", &events, JSON, body.as_bytes()), 400);
    }
    refused(server.ask("POST", &events, JSON, &[b'['; 10_000]), 400);
    refused(server.ask("POST", &events, JSON, &[b' '; 1 << 20]), 413);
    let late = json!({ "seq": 2, "at": 99_999_999_999_999u64, "event": { "kind": "pause" } });
    refused(server.post(&events, &late), 422);
    refused(server.post("/api/sessions", &json!({ "group": "c" })), 422);
    refused(server.post("/api/sessions", &json!({})), 400);
    // Half a body, and bytes that are no HTTP: the server goes on.
    let half = format!(
        "POST {events} HTTP/1.1\r\nhost: {}\r\ncontent-length: 50\r\n{JSON}\r\n{{\"seq\"",
        server.address
    );
    TcpStream::connect(server.address).unwrap().write_all(half.as_bytes()).unwrap();
    server.exchange(b"\x16\x03\x01\x02\x00\x01\x00\r\n\r\n");
    assert_eq!(step(&server, &code, 2, 1).0, 200);
}

#[test]
fn repeated_and_forged_events_change_nothing() {
    let (folder, server) = served();
    let code = session(&server);
    let first = step(&server, &code, 2, 1);
    assert_eq!(first.0, 200);
    // Again: acknowledged again, and not counted twice.
    assert_eq!(step(&server, &code, 2, 1), first);
    // Another event of that number, a gap, and a step that cannot have happened.
    refused(step(&server, &code, 2, 2), 409);
    refused(step(&server, &code, 9, 2), 409);
    refused(step(&server, &code, 3, 4), 422);
    assert_eq!(step(&server, &code, 3, 4).1["next_seq"], 3);
    assert_eq!(step(&server, &code, 3, 2).0, 200);
    // Two requests of the same number at once: one event.
    std::thread::scope(|scope| {
        let both = [0, 1].map(|_| scope.spawn(|| step(&server, &code, 4, 3).0));
        for status in both.map(|t| t.join().unwrap()) {
            assert_eq!(status, 200);
        }
    });
    let study = folder.study();
    let record = noisefloor_study::store::read_one(&study.database, &study.design(), &code).unwrap();
    assert_eq!(record.events.iter().map(|e| e.seq).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
}

#[test]
fn codes_are_needed_and_cannot_be_tried() {
    let (_folder, server) = served();
    let code = session(&server);
    // As it was noted down: lower case, with hyphens.
    let noted = format!("{}-{}-{}", &code[..4], &code[4..8], &code[8..]).to_lowercase();
    server.get(&format!("/api/sessions/{noted}"));
    server.get(&format!("/api/sessions/{code}/export"));
    assert_eq!(server.delete(&format!("/api/sessions/{code}")).0, 204);
    refused(server.ask("GET", &format!("/api/sessions/{code}"), "", b""), 404);
    refused(step(&server, &code, 2, 1), 404);
    refused(server.delete(&format!("/api/sessions/{code}")), 404);
    // Guesses are refused after thirty different ones; a session under way goes on meanwhile.
    let valid = session(&server);
    for wrong in 0..40 {
        let (status, _) = server.ask("GET", &format!("/api/sessions/{wrong:012}"), "", b"");
        assert_eq!(status, if wrong < 29 { 404 } else { 429 }, "{wrong}");
    }
    assert_eq!(step(&server, &valid, 2, 1).0, 200);
    server.get(&format!("/api/sessions/{valid}"));
}

/// A server that is started again goes on with the sessions that were under way.
#[test]
fn sessions_outlive_the_server() {
    let (folder, server) = served();
    let code = session(&server);
    assert_eq!(step(&server, &code, 2, 1).0, 200);
    drop(server);
    let server = Running::start(folder.study());
    let view = server.get(&format!("/api/sessions/{code}"));
    assert_eq!((&view["next_seq"], &view["trial"]["levels"][0]), (&3.into(), &1.into()));
    assert_eq!(step(&server, &code, 3, 2).0, 200);
}

/// Answers to one design are not taken for answers to another.
#[test]
fn a_database_goes_with_one_study() {
    let (folder, server) = served();
    drive(&server.url, "a", &mut public(1, &[40.0, 80.0]).draw(1), |_| ()).unwrap();
    drop(server);
    let text = std::fs::read_to_string(&folder.file).unwrap();
    std::fs::write(&folder.file, text.replace("tile = 32", "tile = 16")).unwrap();
    let study = folder.study();
    let error =
        noisefloor_study::AnswerStore::open(&study.database, &study.design()).unwrap_err().to_string();
    assert!(error.contains("another study"), "{error}");
    // Nor is any other file written to.
    let other = folder.dir.path().join("study.toml");
    assert!(noisefloor_study::AnswerStore::open(&other, &study.design()).is_err());
}

/// Simulated observers come only if whoever runs the study admits them, whatever they say of themselves, and
/// take no completion code away.
#[test]
fn simulated_observers_need_the_operator_and_are_not_paid() {
    let more = "[participants]\nlinks-only = true\ncompletion-code = \"C0DE\"\n\
                completion-url = \"https://example.org/paid\"\n\
                screened-out-url = \"https://example.org/out\"";
    let folder = Folder::new("acquisition", &["wall"], &levels(6, 2.0), more);
    let (unlinked, simulated) = (json!({ "group": "" }), json!({ "group": "", "simulated": true }));
    let people = Running::for_people(folder.study());
    let answer = people.post("/api/sessions", &simulated);
    let said = answer.1.to_string();
    assert!(said.contains("not admitted") && said.contains("study simulate"), "{said}");
    refused(answer, 422);
    refused(people.post("/api/sessions", &unlinked), 422);
    drop(people);

    let rehearsal = Running::start(folder.study());
    refused(rehearsal.post("/api/sessions", &unlinked), 422);
    let code = drive(&rehearsal.url, "", &mut public(1, &[150.0, 600.0]).draw(1), |_| ()).unwrap();
    let view = rehearsal.get(&format!("/api/sessions/{code}"));
    assert_eq!(view["stage"], "finished", "{view}");
    let completion = &view["completion"];
    assert!(completion["code"].is_null() && completion["url"].is_null(), "{completion}");
}

/// Half a header does not keep the server: it ends without it.
#[test]
fn half_sent_headers_hold_nothing() {
    let (_folder, server) = served();
    let half = |_| {
        let mut stream = TcpStream::connect(server.address).unwrap();
        stream.write_all(b"POST /api/sessions HTTP/1.1\r\nhost").unwrap();
        stream
    };
    let held: Vec<TcpStream> = (0..20).map(half).collect();
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
    assert!(server.get("/api/study")["stacks"].is_array());
}
