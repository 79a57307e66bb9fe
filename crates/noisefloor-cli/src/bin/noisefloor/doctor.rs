//! `noisefloor doctor`.

use noisefloor_cli::say::{note, say};
use noisefloor_cli::sources::ADAPTERS;
use noisefloor_denoise::OIDN;
use noisefloor_sidecar::{Renderer, SetupError, find, gpus, install, probe};
use std::process::ExitCode;

/// What to look at, or to install.
pub struct DoctorJob {
    pub install: Option<&'static Renderer>,
}

/// One line of the table, and what is to be said below it.
struct Row {
    cells: [String; 4],
    notes: Vec<String>,
    broken: bool,
}

pub fn run(job: &DoctorJob) -> anyhow::Result<ExitCode> {
    if let Some(renderer) = job.install {
        let python = install(renderer, |line| note!("{line}"))?;
        say!("{} is installed: {}", renderer.title, python.display())?;
        for text in notes(renderer) {
            say!("note: {text}")?;
        }
        return Ok(ExitCode::SUCCESS);
    }
    let own = [env!("CARGO_PKG_VERSION"), "built in"].map(str::to_owned);
    let [version, place] = own;
    let ptwne = Row { cells: ["ptwne".into(), "yes".into(), version, place], notes: vec![], broken: false };
    // Several sources may be one renderer's
    let renderers = ADAPTERS.iter().filter(|adapter| adapter.name == adapter.renderer.name);
    let others = renderers.map(|adapter| adapter.renderer).chain([&OIDN]);
    let rows: Vec<Row> = std::iter::once(ptwne).chain(others.map(examine)).collect();
    let line = |cells: [&str; 4]| say!("{:10} {:7} {:10} {}", cells[0], cells[1], cells[2], cells[3]);
    line(["renderer", "usable", "version", "where"])?;
    for row in &rows {
        line(row.cells.each_ref().map(String::as_str))?;
        for text in &row.notes {
            say!("{:10} {text}", "")?;
        }
    }
    Ok(if rows.iter().any(|row| row.broken) { ExitCode::FAILURE } else { ExitCode::SUCCESS })
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
    let place = python.as_ref().map_or_else(|_| "-".to_owned(), |python| python.display().to_string());
    let (usable, version, notes, broken) = match python.and_then(|python| probe(renderer, &python)) {
        Ok(version) => {
            let devices = found.as_ref().map(|python| gpus(renderer, python));
            // A renderer that works is no worse for what it does not say
            let devices = devices.and_then(Result::ok).unwrap_or_default();
            ("yes", version, [notes(renderer), devices].concat(), false)
        }
        Err(SetupError::Missing { .. }) => {
            ("no", "-".to_owned(), vec![format!("not installed: noisefloor doctor --install {name}")], false)
        }
        Err(error) => {
            let cure = match std::env::var_os(renderer.variable()) {
                Some(_) => format!("correct {} or unset it", renderer.variable()),
                None => format!("make it anew: noisefloor doctor --install {name}"),
            };
            let error = error.to_string().replace('\n', " ");
            ("no", "-".to_owned(), vec![format!("broken: {error}; {cure}")], true)
        }
    };
    Row { cells: [name.to_owned(), usable.to_owned(), version, place], notes, broken }
}
