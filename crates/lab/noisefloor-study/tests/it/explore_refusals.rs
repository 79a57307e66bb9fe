use crate::explore::{question, setup};
use crate::kit::{JSON, Running, refused, stack};
use serde_json::{Value, json};

/// Broken, oversized and misnamed pictures.
#[test]
fn malformed_pictures_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let server = Running::explorer(setup(dir.path()));
    let octets = "content-type: application/octet-stream\r\n";
    let file = |name: &str, bytes: &[u8]| server.ask("POST", &format!("/api/pictures/{name}"), octets, bytes);
    refused(file("a.png", b"no picture"), 422);
    refused(file("a.png", b""), 422);
    let whole = std::fs::read(dir.path().join("wall/00100.png")).unwrap();
    refused(file("a.png", &whole[..whole.len() / 2]), 422);
    refused(file("..%2fa.png", &whole), 422);
    refused(file("..%5Ca.png", &whole), 422);
    refused(file("a%00.png", &whole), 422);
    refused(file(&"a".repeat(300), &whole), 422);
    // A header, whole but for its size, that announces 8000×8000 pixels: refused before any is allocated
    let mut large = whole.clone();
    large[16..24].copy_from_slice(&[0, 0, 0x1f, 0x40, 0, 0, 0x1f, 0x40]);
    let sum = crc32(&large[12..29]);
    large[29..33].copy_from_slice(&sum.to_be_bytes());
    let answer = file("large.png", &large);
    assert!(answer.1["what"].as_str().unwrap().contains("8000×8000 pixels exceed"), "{}", answer.1);
    refused(answer, 422);
    let long = format!("{octets}content-length: {}\r\n", 1u64 << 40);
    refused(server.ask("POST", "/api/pictures/a.png", &long, b"x"), 413);
    stack(&dir.path().join("other"), (64, 64), &[50]);
    refused(file("00050.png", &std::fs::read(dir.path().join("other/00050.png")).unwrap()), 422);
    // The same once more is the same
    assert_eq!(file("again.png", &whole).0, 201);
    assert_eq!(server.get("/api/state")["pictures"].as_array().unwrap().len(), 3);
}

/// Samples, arrangements, questions, and models that are not there.
#[test]
fn malformed_questions_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let server = Running::explorer(setup(dir.path()));
    let picture = server.get("/api/state")["pictures"][0].clone();
    let id = picture["id"].as_str().unwrap();
    for spp in [json!(0), json!(-1), json!(1e300), json!("many"), Value::Null] {
        let answer = server.put(&format!("/api/pictures/{id}"), &json!({ "spp": spp }));
        assert!(answer.0 == 422 || answer.0 == 400, "{spp}: {}", answer.1);
    }
    refused(server.put("/api/pictures/absent", &json!({ "spp": 5 })), 404);
    refused(server.put("/api/arrangement", &json!({ "tile": 8, "samples": null, "scene": null })), 422);
    refused(server.put("/api/arrangement", &json!({ "tile": 64, "samples": "twice", "scene": null })), 422);
    refused(
        server.put("/api/arrangement", &json!({ "tile": 64, "samples": null, "scene": "x".repeat(500) })),
        422,
    );
    refused(server.post("/api/verdicts", &json!({ "picture": id })), 400);
    refused(server.post("/api/verdicts", &question(&json!({ "id": "absent" }))), 404);
    let mut unknown = question(&picture);
    unknown["retrained"] = json!(true);
    refused(server.post("/api/verdicts", &unknown), 404);
    refused(server.post("/api/verdicts", &json!("x".repeat(20_000))), 413);

    // Retraining without a table, without answers; models that are not there
    refused(server.post("/api/retrain", &json!({ "people": 0.9 })), 422);
    refused(server.post("/api/retrain", &json!({ "people": 2 })), 422);
    refused(server.ask("GET", "/api/retrained.nfm", "", b""), 404);
}

/// What the model said cannot be sent along, and tiles have to be there. Said twice, it is one answer.
#[test]
fn forged_and_repeated_answers_change_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let server = Running::explorer(setup(dir.path()));
    let picture = server.get("/api/state")["pictures"][0].clone();
    let said = json!({ "question": question(&picture), "tile": 2, "sees_noise": true });
    refused(server.post("/api/disagreements", &said), 404);
    let mut forged = json!({ "question": question(&picture), "tile": 0, "sees_noise": true });
    (forged["probability"], forged["numbers"]) = (json!(1.0), json!([0.0]));
    refused(server.post("/api/disagreements", &forged), 400);
    refused(server.delete("/api/disagreements/1"), 404);
    refused(server.delete("/api/disagreements/one"), 404);
    assert_eq!(server.get("/api/state")["disagreements"], 0);
    // TileAnswer twice, it is one; the other way round, it is changed; and taken back once
    let yes = json!({ "question": question(&picture), "tile": 0, "sees_noise": true });
    let no = json!({ "question": question(&picture), "tile": 0, "sees_noise": false });
    let (_, first) = server.post("/api/disagreements", &yes);
    let (_, second) = server.post("/api/disagreements", &yes);
    let (_, third) = server.post("/api/disagreements", &no);
    let before = [&first["before"], &second["before"], &third["before"]];
    assert_eq!(before, [&Value::Null, &json!(true), &json!(true)]);
    assert_eq!(
        (&third["disagreements"], server.get("/api/state")["disagreements"].clone()),
        (&json!(1), json!(1))
    );
    refused(server.delete(&format!("/api/disagreements/{}", first["id"])), 404);
    assert_eq!(server.delete(&format!("/api/disagreements/{}", third["id"])).0, 204);
    refused(server.delete(&format!("/api/disagreements/{}", third["id"])), 404);
}

/// The guard is that of studies, which tests/it/api.rs asks about the rest.
#[test]
fn requests_of_other_sites_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let server = Running::explorer(setup(dir.path()));
    let picture = server.get("/api/state")["pictures"][0].clone();
    let yes = json!({ "question": question(&picture), "tile": 0, "sees_noise": true }).to_string();
    let other = format!("{JSON}origin: http://evil.example\r\n");
    refused(server.ask("POST", "/api/disagreements", &other, yes.as_bytes()), 403);
    assert_eq!(server.get("/api/state")["disagreements"], 0);
}

/// The checksum of a PNG's chunk.
fn crc32(bytes: &[u8]) -> u32 {
    let bit = |crc: u32| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
    !bytes.iter().fold(!0u32, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), |crc, _| bit(crc)))
}
