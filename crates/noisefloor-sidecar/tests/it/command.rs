use noisefloor::{ProgressiveSource, Request, SourceError, Tile, TileGrid};
use noisefloor_sidecar::{CommandError, CommandOptions, CommandSource};
use noisefloor_testkit::{HANG, require_python};
use std::collections::HashSet;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/renderer.py");
/// What renderer.py renders.
const SIZE: (usize, usize) = (20, 12);

fn options(scene: Option<&str>) -> CommandOptions {
    let mut options = CommandOptions::default();
    (options.scene, options.timeout) = (scene.map(PathBuf::from), HANG);
    options
}

/// A command with all it needs, and the log of its runs.
fn template(python: &Path, folder: &Path, more: &str) -> String {
    let log = folder.join("log");
    let python = python.display();
    format!("{python} '{SCRIPT}' 'log={}' seed={{seed}} spp={{spp}} out={{out}}.pfm {more}", log.display())
}

fn log(folder: &TempDir) -> Vec<String> {
    let text = std::fs::read_to_string(folder.path().join("log")).unwrap_or_default();
    text.lines().map(str::to_owned).collect()
}

fn tile(index: usize, x: usize, y: usize, width: usize, height: usize) -> Tile {
    Tile { index, x, y, width, height }
}

fn expected(tile: &Tile, samples: u64) -> Vec<[f32; 3]> {
    let rows = tile.y..tile.y + tile.height;
    let pixel = |x: usize, y: usize| [x as f32, y as f32, samples as f32];
    rows.flat_map(|y| (tile.x..tile.x + tile.width).map(move |x| pixel(x, y))).collect()
}

/// Tile by tile, whether the command leaves the tile or the whole; the size is found out where the whole
/// tells it.
#[test]
fn a_command_that_aims_renders_tiles() {
    let Some(python) = require_python() else { return };
    for how in ["tile", "whole"] {
        let folder = tempfile::tempdir().unwrap();
        let more = format!("x0={{x0}} x1={{x1}} y0={{y0}} y1={{y1}} how={how}");
        let size = (how == "tile").then_some(SIZE);
        let command = template(&python, folder.path(), &more);
        let mut options = options(None);
        options.size = size;
        let mut source = CommandSource::new(&command, options).unwrap();
        let info = source.info();
        assert_eq!((info.width, info.height, info.aims), (SIZE.0, SIZE.1, true));
        let requests = [(tile(4, 3, 5, 7, 6), 9), (tile(0, 0, 0, 20, 12), 2), (tile(4, 3, 5, 7, 6), 9)]
            .map(|(tile, samples)| Request::new(tile, 0, samples));
        for (request, batch) in requests.iter().zip(source.sample(&requests).unwrap()) {
            assert_eq!((batch.tile, batch.spp), (request.tile, request.spp));
            assert_eq!(batch.mean, expected(&request.tile, request.spp), "{how}");
        }
        // Every run has a seed of its own, also for the same tile
        let seeds: HashSet<_> =
            log(&folder).iter().map(|line| line.split(' ').next().unwrap().to_owned()).collect();
        assert_eq!(seeds.len(), log(&folder).len());
    }
}

#[test]
fn a_command_that_cannot_aim_renders_all_tiles_at_once() {
    let Some(python) = require_python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut source = CommandSource::new(&template(&python, folder.path(), ""), options(None)).unwrap();
    let info = source.info();
    assert_eq!((info.width, info.height, info.aims), (SIZE.0, SIZE.1, false));
    let tiles: Vec<_> = TileGrid::new(SIZE.0, SIZE.1, 16).unwrap().tiles().collect();
    let requests: Vec<_> = tiles.iter().map(|&tile| Request::new(tile, 0, 5)).collect();
    for batch in source.sample(&requests).unwrap() {
        assert_eq!((batch.spp, batch.mean), (5, expected(&batch.tile, 5)));
    }
    // One run for the size, one for all tiles
    let samples: Vec<_> =
        log(&folder).iter().map(|line| line.split(' ').nth(1).unwrap().to_owned()).collect();
    assert_eq!(samples, ["1", "5"]);
}

#[test]
fn templates_that_cannot_work_are_refused() {
    for (template, words) in [
        ("", "it is empty"),
        ("render 'scene", "a quote is not closed"),
        ("render {seed} {spp}", "{out} is missing"),
        ("render {spp} {out}", "{seed} is missing"),
        ("render {seed} {out}", "{spp} is missing"),
        ("render {seed} {spp} {out} {x0} {y0} {y1}", "{x1} is missing"),
        ("render {seed} {spp} {out} {threads}", "{threads} is not a placeholder"),
        ("render {seed} {spp} {out} {scene}", "no scene is given"),
        ("render {seed} {spp} {out} {width}", "--size"),
        ("render {seed} {spp} {out} {x0} {x1} {y0} {y1} {height}", "--size"),
    ] {
        let error = CommandSource::new(template, options(None)).unwrap_err().to_string();
        assert!(error.contains(words), "{template}: {error}");
    }
    let error = CommandSource::new("render {seed} {spp} {out}", options(Some("a.scene"))).unwrap_err();
    assert!(error.to_string().contains("it does not contain {scene}"), "{error}");
    let error = CommandSource::new("/no/such/program {seed} {spp} {out}", options(None)).unwrap_err();
    assert!(matches!(&error, CommandError::Start { program, .. } if program == "/no/such/program"));
}

#[test]
fn failures_are_told_with_the_last_words() {
    let Some(python) = require_python() else { return };
    let folder = tempfile::tempdir().unwrap();
    for (how, words) in [
        ("fail", "exit status: 3; its last words: no lamp in hall scene.xml"),
        ("hang", "not finished after 1 s"),
        ("nothing", "it wrote no file"),
        ("two", "picture.pfm.bak"),
        ("larger", "its picture has 5×4 pixels, neither 4×4 as requested"),
        ("garbage", "is something else"),
    ] {
        let more = format!("x0={{x0}} x1={{x1}} y0={{y0}} y1={{y1}} scene={{scene}} how={how}");
        let timeout = Duration::from_secs(if how == "hang" { 1 } else { 60 });
        let mut options = options(Some("hall scene.xml"));
        (options.size, options.timeout) = (Some(SIZE), timeout);
        let mut source = CommandSource::new(&template(&python, folder.path(), &more), options).unwrap();
        let tile = tile(2, 4, 4, 4, 4);
        let error = source.sample(&[Request::new(tile, 0, 1)]).unwrap_err();
        let SourceError::Failed { tile: Some(2), cause, .. } = &error else { panic!("{error:?}") };
        assert!(cause.to_string().contains(words), "{how}: {cause}");
    }
}

/// What a command starts ends with it; a scene may have any file name; what it prints is made safe.
#[cfg(target_os = "linux")]
#[test]
fn a_command_leaves_nothing_and_takes_any_name() {
    use std::os::unix::ffi::OsStrExt;
    let Some(python) = require_python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join(std::ffi::OsStr::from_bytes(b"hall\xff.xml"));
    std::fs::write(&scene, "a scene").unwrap();
    let more = "x0={x0} x1={x1} y0={y0} y1={y1} exists={scene} how=fork";
    let mut options = options(None);
    (options.scene, options.size) = (Some(scene), Some(SIZE));
    let mut source = CommandSource::new(&template(&python, folder.path(), more), options.clone()).unwrap();
    source.sample(&[Request::new(tile(0, 0, 0, 4, 4), 0, 1)]).unwrap();
    let pid = std::fs::read_to_string(folder.path().join("log.fork")).unwrap();
    let pid = pid.parse().unwrap();
    assert!(crate::life::gone_within(pid, HANG), "process {pid} is left behind");

    let more = "x0={x0} x1={x1} y0={y0} y1={y1} exists={scene} how=paint";
    let mut source = CommandSource::new(&template(&python, folder.path(), more), options).unwrap();
    let error = source.sample(&[Request::new(tile(0, 0, 0, 4, 4), 0, 1)]).unwrap_err();
    let said = error.source().unwrap().to_string();
    assert!(said.contains("\\u{1b}]0;owned\\u{7}") && !said.contains('\x1b'), "{said:?}");
}
