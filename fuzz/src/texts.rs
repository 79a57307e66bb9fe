//! Tables, replies of renderers, and what browsers send.

use noisefloor::Params;
use noisefloor::display::parse_cube;
use noisefloor_eyes::Eyes;
use noisefloor_learn::{read_table, write_table};
use noisefloor_study::{Beginning, Envelope, ParticipantSession, Plan, Study, grids, parse_code};
use std::sync::Arc;

pub(crate) fn table(bytes: &[u8]) -> bool {
    let Ok(table) = read_table(bytes) else { return false };
    // What can be read can be written so that it reads back
    let mut again = Vec::new();
    write_table(&table, &mut again).expect("a table that was read can be written");
    read_table(again.as_slice()).expect("and read again");
    true
}

pub(crate) fn table_seeds() -> Vec<Vec<u8>> {
    let whole = include_str!("../../fixtures/human-table.csv");
    vec![whole.lines().take(12).flat_map(|line| [line, "\n"]).collect::<String>().into_bytes()]
}

/// A LUT: what it makes of colours is finite.
pub(crate) fn cube(bytes: &[u8]) -> bool {
    let Ok(lut) = parse_cube(bytes) else { return false };
    for colour in [[0.0; 3], [0.3, 0.9, 2.0], [-1.0, f32::MAX, f32::NAN]] {
        assert!(lut.map(colour).iter().all(|c| !c.is_nan()));
    }
    true
}

pub(crate) fn cube_seeds() -> Vec<Vec<u8>> {
    let curve = "TITLE \"a\"\n# b\nLUT_1D_SIZE 2\nLUT_1D_INPUT_RANGE 0 8\n";
    let corners: String = (0..8).map(|i| format!("{} {} {}\n", i % 2, i / 2 % 2, i / 4)).collect();
    vec![
        format!("{curve}LUT_3D_SIZE 2\n0 0 0\n1 1e0 +1.0\n{corners}").into_bytes(),
        format!("LUT_3D_SIZE 2\nDOMAIN_MIN -1 0 0\nDOMAIN_MAX 1 2 3\n{corners}").into_bytes(),
    ]
}

pub(crate) fn wire(bytes: &[u8]) -> bool {
    noisefloor_sidecar::read_any_reply(bytes)
}

pub(crate) fn wire_seeds() -> Vec<Vec<u8>> {
    let frame = |header: &str, payload: usize| {
        let lengths = [header.len() as u32, payload as u32].map(u32::to_le_bytes).concat();
        [&lengths, header.as_bytes(), &vec![0x3e; payload]].concat()
    };
    let hello = r#"{"ok":true,"name":"a","width":8,"height":8,"unit":"samples-per-pixel","#;
    let more = r#""repeats":"samples","warnings":["b"]}"#;
    vec![
        frame(&format!("{hello}{more}"), 0),
        frame(r#"{"ok":true,"samples":[1,0]}"#, 12 * 16),
        frame(r#"{"ok":true,"reference":true}"#, 12 * 64),
        frame(r#"{"ok":false,"error":"no lamp","tile":1}"#, 0),
    ]
}

/// What `noisefloor calibrate` keeps.
pub(crate) fn eyes(bytes: &[u8]) -> bool {
    let Some(eyes) = std::str::from_utf8(bytes).ok().and_then(|text| Eyes::parse(text).ok()) else {
        return false;
    };
    let person = eyes.strictest();
    let params = Params::default().with_audience(person.audience()).with_viewing(person.viewing());
    assert!(params.check().is_ok(), "{person:?}");
    true
}

pub(crate) fn eyes_seeds() -> Vec<Vec<u8>> {
    let person = "[[person]]\nname = \"a\"\nfactor = 1.5\ninterval = [1.25, 2]\nscatter = 0.25\nanswers = 40\n\
        date = \"2026-11-24\"\nmodel = \"b\"\n[person.display]\npixels-per-degree = 60\ndistance-mm = 500\n\
        gamma = 2.2\nambient = \"dim\"\n";
    vec![format!("version = 1\n{person}{person}").into_bytes()]
}

/// A body a line: a beginning, a code, or an event, which moves a session on.
pub(crate) fn study(bytes: &[u8]) -> bool {
    thread_local!(static FRESH: ParticipantSession = fresh());
    let (mut session, mut moved) = (FRESH.with(Clone::clone), false);
    for line in bytes.split(|&b| b == b'\n') {
        let _ = serde_json::from_slice::<Beginning>(line);
        let _ = std::str::from_utf8(line).map(parse_code);
        let Ok(envelope) = serde_json::from_slice::<Envelope>(line) else { continue };
        let before = (session.stage(), session.progress());
        if !envelope.has_sane_clock() || session.apply(&envelope.event).is_err() {
            assert_eq!((session.stage(), session.progress()), before, "a refused event changes nothing");
        } else {
            moved = true;
        }
    }
    moved
}

/// A session of a small study by forced choice.
fn fresh() -> ParticipantSession {
    let folder = tempfile::tempdir().expect("a folder for a study");
    std::fs::create_dir(folder.path().join("wall")).expect("an empty folder");
    for spp in [10, 100, 1000] {
        let path = folder.path().join(format!("wall/{spp:05}.png"));
        noisefloor_image::write_png(path, 32, 16, &vec![128; 3 * 32 * 16]).expect("a small picture");
    }
    let text = "protocol = \"acquisition\"\ndatabase = \"answers.sqlite\"\ntile = 16\n[text.en]\n\
                title = \"a\"\nconsent = \"b\"\n[[stack]]\nname = \"wall\"\nfolder = \"wall\"\n";
    let file = folder.path().join("study.toml");
    std::fs::write(&file, text).expect("space for a study");
    let study = Arc::new(Study::open(&file).expect("a valid study"));
    ParticipantSession::new(study.clone(), grids(&study), Plan::draw(&study, 1))
}

pub(crate) fn study_seeds() -> Vec<Vec<u8>> {
    let conditions = r#"{"kind":"conditions","pixels-per-mm":4,"distance-mm":600,"pixel-ratio":1,"zoom":1,"#;
    let screen = r#""colour-depth":24,"screen-width":1920,"screen-height":1080,"gamma":2.2,"ambient":"dim"}"#;
    let events = [
        r#"{"kind":"consent","language":"en"}"#,
        &format!("{conditions}{screen}"),
        r#"{"kind":"step","trial":0,"tile":1,"level":1}"#,
        r#"{"kind":"pause"}"#,
        r#"{"kind":"resume"}"#,
        r#"{"kind":"done","trial":0}"#,
        r#"{"kind":"answer","trial":1,"choice":"identical"}"#,
    ];
    let mut body = "{\"group\":\"\",\"simulated\":true}\n".to_owned();
    for (seq, event) in events.iter().enumerate() {
        body += &format!("{{\"seq\":{seq},\"at\":1700000000000,\"event\":{event}}}\n");
    }
    vec![body.into_bytes()]
}
