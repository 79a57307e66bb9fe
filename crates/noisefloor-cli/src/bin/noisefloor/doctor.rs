//! `noisefloor doctor`.

use crate::args::DoctorArgs;
use noisefloor_cli::say::{note, say, say_json};
use noisefloor_cli::sources::ADAPTERS;
use noisefloor_denoise::OIDN;
use noisefloor_sidecar::{Renderer, SetupError, find, gpus, install, probe};
use serde::Serialize;
use std::process::ExitCode;

/// One line of the table, and what is to be said below it.
#[derive(Serialize)]
struct Row {
    renderer: &'static str,
    usable: bool,
    version: Option<String>,
    #[serde(rename = "where")]
    place: Option<String>,
    notes: Vec<String>,
    /// Whether it is installed and does not load.
    broken: bool,
}

pub fn run(args: &DoctorArgs) -> anyhow::Result<ExitCode> {
    if let Some(renderer) = args.install {
        let python = install(renderer, |line| note!("{line}"))?;
        say!("{} is installed: {}", renderer.title, python.display())?;
        for text in notes(renderer) {
            say!("note: {text}")?;
        }
        return Ok(ExitCode::SUCCESS);
    }
    let [version, place] = [env!("CARGO_PKG_VERSION"), "built in"].map(|text| Some(text.to_owned()));
    let ptwne = Row { renderer: "ptwne", usable: true, version, place, notes: vec![], broken: false };
    // Several sources may be one renderer's
    let renderers = ADAPTERS.iter().filter(|adapter| adapter.name == adapter.renderer.name);
    let others = renderers.map(|adapter| adapter.renderer).chain([&OIDN]);
    let rows: Vec<Row> = std::iter::once(ptwne).chain(others.map(examine)).collect();
    let ended = if rows.iter().any(|row| row.broken) { ExitCode::FAILURE } else { ExitCode::SUCCESS };
    if args.json {
        say_json(&rows)?;
        return Ok(ended);
    }
    let line = |cells: [&str; 4]| say!("{:10} {:7} {:10} {}", cells[0], cells[1], cells[2], cells[3]);
    line(["renderer", "usable", "version", "where"])?;
    for row in &rows {
        let [version, place] = [&row.version, &row.place].map(|text| text.as_deref().unwrap_or("-"));
        line([row.renderer, if row.usable { "yes" } else { "no" }, version, place])?;
        for text in &row.notes {
            say!("{:10} {text}", "")?;
        }
    }
    Ok(ended)
}

/// What keeps a renderer from being all it could be here.
fn notes(renderer: &Renderer) -> Vec<String> {
    let adapter = ADAPTERS.iter().find(|adapter| adapter.renderer.name == renderer.name);
    adapter.map(|adapter| (adapter.notes)()).unwrap_or_default()
}

fn examine(renderer: &Renderer) -> Row {
    let name = renderer.name;
    let python = find(renderer);
    let found = python.as_ref().ok().cloned();
    let place = python.as_ref().ok().map(|python| python.display().to_string());
    let (usable, version, notes, broken) = match python.and_then(|python| probe(renderer, &python)) {
        Ok(version) => {
            let devices = found.as_ref().map(|python| gpus(renderer, python));
            // A renderer that works is no worse for what it does not say
            let devices = devices.and_then(Result::ok).unwrap_or_default();
            (true, Some(version), [notes(renderer), devices].concat(), false)
        }
        Err(SetupError::Missing { .. }) => {
            (false, None, vec![format!("not installed: noisefloor doctor --install {name}")], false)
        }
        Err(error) => {
            let cure = match std::env::var_os(renderer.variable()) {
                Some(_) => format!("correct {} or unset it", renderer.variable()),
                None => format!("make it anew: noisefloor doctor --install {name}"),
            };
            let error = error.to_string().replace('\n', " ");
            (false, None, vec![format!("broken: {error}; {cure}")], true)
        }
    };
    Row { renderer: name, usable, version, place, notes, broken }
}
