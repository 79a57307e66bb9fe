use crate::kit::{Folder, Running, levels, public};
use noisefloor_study::simulated::drive;
use noisefloor_testkit::HANG;
use std::io::{Read, Write};
use std::net::TcpStream;

/// One answer: status, headers in lower case, body.
struct Answer {
    status: u16,
    head: String,
    body: String,
}

/// Sends bytes as they are, and reads until the server closes.
fn raw(server: &Running, bytes: &[u8]) -> Answer {
    let mut stream = TcpStream::connect(server.address).unwrap();
    stream.set_read_timeout(Some(HANG)).unwrap();
    // The server may answer and close before it has read everything
    drop(stream.write_all(bytes));
    let mut text = Vec::new();
    drop(stream.read_to_end(&mut text));
    let text = String::from_utf8_lossy(&text).into_owned();
    let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
    let status = head.split(' ').nth(1).and_then(|s| s.parse().ok()).unwrap_or(0);
    Answer { status, head: head.to_lowercase(), body: body.to_owned() }
}

fn request(server: &Running, method: &str, path: &str, headers: &str, body: &str) -> Answer {
    let host =
        if headers.contains("host:") { String::new() } else { format!("host: {}\r\n", server.address) };
    let length = body.len();
    let text = format!(
        "{method} {path} HTTP/1.1\r\n{host}connection: close\r\n\
         content-length: {length}\r\n{headers}\r\n{body}"
    );
    raw(server, text.as_bytes())
}

const JSON: &str = "content-type: application/json\r\n";

fn post(server: &Running, path: &str, body: &str) -> Answer {
    request(server, "POST", path, JSON, body)
}

/// A refusal says what, where and what to do.
fn refused(answer: &Answer, status: u16) {
    assert_eq!(answer.status, status, "{} {}", answer.head, answer.body);
    let body: serde_json::Value = serde_json::from_str(&answer.body).unwrap();
    for part in ["what", "where", "what_to_do"] {
        assert!(body[part].as_str().is_some_and(|s| s.len() > 1), "{part}: {}", answer.body);
    }
    assert!(!answer.body.contains("/tmp"), "paths of the machine: {}", answer.body);
}

fn served() -> (Folder, Running) {
    let folder = Folder::new("acquisition", &["wall"], &levels(6, 2.0), "groups = [\"a\", \"b\"]");
    let server = Running::start(folder.study());
    (folder, server)
}

/// A session that is at its first trial; its code and next number.
fn session(server: &Running) -> String {
    let begun = post(server, "/api/sessions", "{\"group\":\"a\"}");
    assert_eq!(begun.status, 201, "{}", begun.body);
    let view: serde_json::Value = serde_json::from_str(&begun.body).unwrap();
    let code = view["code"].as_str().unwrap().to_owned();
    let events = public(1, &[1.0, 1.0]).draw(0).arrive("en", &[]);
    for (seq, event) in events.iter().enumerate() {
        let event = serde_json::to_string(event).unwrap();
        let body = format!("{{\"seq\":{seq},\"at\":1000,\"event\":{event}}}");
        assert_eq!(post(server, &format!("/api/sessions/{code}/events"), &body).status, 200);
    }
    code
}

fn step(server: &Running, code: &str, seq: u64, level: u32) -> Answer {
    let event = format!("{{\"kind\":\"step\",\"trial\":0,\"tile\":0,\"level\":{level},\"ms\":900}}");
    post(
        server,
        &format!("/api/sessions/{code}/events"),
        &format!("{{\"seq\":{seq},\"at\":1,\"event\":{event}}}"),
    )
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
        let answer = request(&server, "GET", path, "", "");
        assert_eq!(answer.status, 200, "{path}");
        assert!(answer.head.contains(&format!("content-type: {kind}")), "{path}: {}", answer.head);
        assert!(answer.head.contains("content-security-policy: default-src 'none'; script-src 'self'"));
        assert!(answer.head.contains("x-content-type-options: nosniff"));
    }
    let page = request(&server, "GET", "/", "", "").body;
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
        refused(&request(&server, "GET", path, "", ""), 404);
    }
    refused(&request(&server, "PUT", "/api/study", JSON, "{}"), 405);
}

#[test]
fn requests_of_other_sites_and_hosts_are_refused() {
    let (_folder, server) = served();
    let own = format!("origin: http://{}\r\n{JSON}", server.address);
    assert_eq!(request(&server, "POST", "/api/sessions", &own, "{\"group\":\"a\"}").status, 201);
    for (headers, status) in [
        ("host: evil.example\r\n".to_owned(), 421),
        (format!("host: evil.example:{}\r\n", server.address.port()), 421),
        ("origin: http://evil.example\r\n".to_owned(), 403),
        ("origin: null\r\n".to_owned(), 403),
        ("sec-fetch-site: cross-site\r\n".to_owned(), 403),
        ("sec-fetch-site: same-site\r\n".to_owned(), 403),
    ] {
        let answer =
            request(&server, "POST", "/api/sessions", &format!("{headers}{JSON}"), "{\"group\":\"a\"}");
        refused(&answer, status);
        refused(&request(&server, "GET", "/api/study", &headers, ""), status);
    }
    // What a form of another site could send without asking.
    let form = "content-type: text/plain\r\n";
    refused(&request(&server, "POST", "/api/sessions", form, "{\"group\":\"a\"}"), 415);
    assert_eq!(
        request(&server, "GET", "/", &format!("host: localhost:{}\r\n", server.address.port()), "").status,
        200
    );
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
        "{\"seq\":2}",
        "{\"seq\":-1,\"at\":0,\"event\":{\"kind\":\"pause\"}}",
        "{\"seq\":2.5,\"at\":0,\"event\":{\"kind\":\"pause\"}}",
        "{\"seq\":2,\"at\":0,\"event\":{\"kind\":\"shout\"}}",
        "{\"seq\":2,\"at\":0,\"event\":{\"kind\":\"consent\",\"language\":\"en\",\"more\":1}}",
        "{\"seq\":2,\"at\":0,\"extra\":1,\"event\":{\"kind\":\"pause\"}}",
        "{\"seq\":2,\"at\":0,\"event\":{\"kind\":\"step\",\"trial\":0,\"tile\":0,\"level\":99999999999,\"ms\":9}}",
        "\u{0}\u{1}",
    ] {
        refused(&post(&server, &events, body), 400);
    }
    refused(&post(&server, &events, &"[".repeat(10_000)), 400);
    refused(&post(&server, &events, &" ".repeat(1 << 20)), 413);
    refused(&post(&server, &events, "{\"seq\":2,\"at\":99999999999999,\"event\":{\"kind\":\"pause\"}}"), 422);
    refused(&post(&server, "/api/sessions", "{\"group\":\"c\"}"), 422);
    refused(&post(&server, "/api/sessions", "{}"), 400);
    // Half a body, and bytes that are no HTTP: the server goes on.
    let half = format!(
        "POST {events} HTTP/1.1\r\nhost: {}\r\ncontent-length: 50\r\n{JSON}\r\n{{\"seq\"",
        server.address
    );
    TcpStream::connect(server.address).unwrap().write_all(half.as_bytes()).unwrap();
    raw(&server, b"\x16\x03\x01\x02\x00\x01\x00\r\n\r\n");
    assert_eq!(step(&server, &code, 2, 1).status, 200);
}

#[test]
fn repeated_and_forged_events_change_nothing() {
    let (folder, server) = served();
    let code = session(&server);
    let first = step(&server, &code, 2, 1);
    assert_eq!(first.status, 200);
    // Again: acknowledged again, and not counted twice.
    let again = step(&server, &code, 2, 1);
    assert_eq!((again.status, &again.body), (200, &first.body));
    // Another event of that number, a gap, and a step that cannot have happened.
    refused(&step(&server, &code, 2, 2), 409);
    refused(&step(&server, &code, 9, 2), 409);
    refused(&step(&server, &code, 3, 4), 422);
    let next: serde_json::Value = serde_json::from_str(&step(&server, &code, 3, 4).body).unwrap();
    assert_eq!(next["next_seq"], 3);
    assert_eq!(step(&server, &code, 3, 2).status, 200);
    // Two requests of the same number at once: one event.
    std::thread::scope(|scope| {
        let both = [0, 1].map(|_| scope.spawn(|| step(&server, &code, 4, 3).status));
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
    assert_eq!(request(&server, "GET", &format!("/api/sessions/{noted}"), "", "").status, 200);
    assert_eq!(request(&server, "GET", &format!("/api/sessions/{code}/export"), "", "").status, 200);
    assert_eq!(request(&server, "DELETE", &format!("/api/sessions/{code}"), "", "").status, 204);
    refused(&request(&server, "GET", &format!("/api/sessions/{code}"), "", ""), 404);
    refused(&step(&server, &code, 2, 1), 404);
    refused(&request(&server, "DELETE", &format!("/api/sessions/{code}"), "", ""), 404);
    // Guesses are refused after thirty different ones; a session under way goes on meanwhile.
    let valid = session(&server);
    for wrong in 0..40 {
        let status = request(&server, "GET", &format!("/api/sessions/{wrong:012}"), "", "").status;
        assert_eq!(status, if wrong < 29 { 404 } else { 429 }, "{wrong}");
    }
    assert_eq!(step(&server, &valid, 2, 1).status, 200);
    assert_eq!(request(&server, "GET", &format!("/api/sessions/{valid}"), "", "").status, 200);
}

/// A server that is started again goes on with the sessions that were under way.
#[test]
fn sessions_outlive_the_server() {
    let (folder, server) = served();
    let code = session(&server);
    assert_eq!(step(&server, &code, 2, 1).status, 200);
    drop(server);
    let server = Running::start(folder.study());
    let view = request(&server, "GET", &format!("/api/sessions/{code}"), "", "").body;
    let view: serde_json::Value = serde_json::from_str(&view).unwrap();
    assert_eq!((&view["next_seq"], &view["trial"]["levels"][0]), (&3.into(), &1.into()));
    assert_eq!(step(&server, &code, 3, 2).status, 200);
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
    let begin = r#"{"group":"","simulated":true}"#;
    let people = Running::for_people(folder.study());
    let answer = post(&people, "/api/sessions", begin);
    refused(&answer, 422);
    assert!(
        answer.body.contains("not admitted") && answer.body.contains("study simulate"),
        "{}",
        answer.body
    );
    refused(&post(&people, "/api/sessions", r#"{"group":""}"#), 422);
    drop(people);

    let rehearsal = Running::start(folder.study());
    refused(&post(&rehearsal, "/api/sessions", r#"{"group":""}"#), 422);
    let code = drive(&rehearsal.url, "", &mut public(1, &[150.0, 600.0]).draw(1), |_| ()).unwrap();
    let view = request(&rehearsal, "GET", &format!("/api/sessions/{code}"), "", "");
    let view: serde_json::Value = serde_json::from_str(&view.body).unwrap();
    assert_eq!(view["stage"], "finished", "{view}");
    let completion = &view["completion"];
    assert!(completion["code"].is_null() && completion["url"].is_null(), "{completion}");
}
