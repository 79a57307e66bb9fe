//! `noisefloor doctor`.

use crate::args::DoctorArgs;
use crate::sources::{ADAPTERS, Adapter};
use noisefloor_sidecar::{SetupError, find, install, probe};
use std::process::ExitCode;

/// One line of the table, and what is to be said below it.
struct Row {
    cells: [String; 4],
    notes: Vec<String>,
    broken: bool,
}

pub fn run(args: &DoctorArgs) -> anyhow::Result<ExitCode> {
    if let Some(adapter) = args.install {
        let python = install(adapter.renderer, |line| eprintln!("{line}"))?;
        println!("{} is installed: {}", adapter.renderer.title, python.display());
        (adapter.notes)().iter().for_each(|note| println!("note: {note}"));
        return Ok(ExitCode::SUCCESS);
    }
    let own = [env!("CARGO_PKG_VERSION"), "built in"].map(str::to_owned);
    let [version, place] = own;
    let ptwne = Row { cells: ["ptwne".into(), "yes".into(), version, place], notes: vec![], broken: false };
    // Several sources may be one renderer's
    let renderers = ADAPTERS.iter().filter(|adapter| adapter.name == adapter.renderer.name);
    let rows: Vec<Row> = std::iter::once(ptwne).chain(renderers.map(examine)).collect();
    let line = |cells: [&str; 4]| println!("{:10} {:7} {:10} {}", cells[0], cells[1], cells[2], cells[3]);
    line(["renderer", "usable", "version", "where"]);
    for row in &rows {
        line(row.cells.each_ref().map(String::as_str));
        row.notes.iter().for_each(|note| println!("{:10} {note}", ""));
    }
    Ok(if rows.iter().any(|row| row.broken) { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn examine(adapter: &Adapter) -> Row {
    let name = adapter.renderer.name;
    let python = find(adapter.renderer);
    let place = python.as_ref().map_or_else(|_| "-".to_owned(), |python| python.display().to_string());
    let (usable, version, notes, broken) = match python.and_then(|python| probe(adapter.renderer, &python)) {
        Ok(version) => ("yes", version, (adapter.notes)(), false),
        Err(SetupError::Missing { .. }) => {
            ("no", "-".to_owned(), vec![format!("not installed: noisefloor doctor --install {name}")], false)
        }
        Err(error) => {
            let cure = match std::env::var_os(adapter.renderer.variable()) {
                Some(_) => format!("correct {} or unset it", adapter.renderer.variable()),
                None => format!("make it anew: noisefloor doctor --install {name}"),
            };
            let error = error.to_string().replace('\n', " ");
            ("no", "-".to_owned(), vec![format!("broken: {error}; {cure}")], true)
        }
    };
    Row { cells: [name.to_owned(), usable.to_owned(), version, place], notes, broken }
}
