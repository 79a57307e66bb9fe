//! The package for JavaScript, whose module `js/build.sh` has built: its own tests, and the example in a browser.

use noisefloor_testkit::{Requirement, require};
use std::path::{Path, PathBuf};
use std::process::Command;

fn js() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("js")
}

/// Node and the module, or which is missing.
fn package() -> Option<()> {
    let runs = Command::new("node").arg("--version").output().is_ok_and(|output| output.status.success());
    let found = if !runs {
        Err("no node runs")
    } else if !js().join("noisefloor.wasm").exists() {
        Err("noisefloor.wasm is not built (crates/noisefloor-capi/js/build.sh)")
    } else {
        Ok(())
    };
    require(Requirement::Wasm, found)
}

/// Runs a file of tests, which must pass.
fn node(folder: &Path, file: &str) {
    let mut node = Command::new("node");
    node.args(["--expose-gc", "--test", "--test-reporter=spec", file]).current_dir(folder);
    let output = node.output().unwrap();
    println!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "the tests in JavaScript failed; what they said is above");
}

#[test]
fn the_package_keeps_its_promises_in_node() {
    let Some(()) = package() else { return };
    node(&js(), "test/noisefloor.test.mjs");
    node(&js(), "test/tone.test.mjs");
    node(&js(), "test/background.test.mjs");
}

/// three.js and three-gpu-pathtracer from npm, in Chromium, without a GPU.
#[test]
fn the_example_stops_in_a_browser() {
    let Some(()) = package() else { return };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/10-three-gpu-pathtracer");
    let found = if !Path::new("/usr/bin/chromium").exists() {
        Err("no /usr/bin/chromium (apt-get install chromium)".to_owned())
    } else if !folder.join("node_modules").exists() {
        Err("no packages (npm ci --ignore-scripts in examples/10-three-gpu-pathtracer)".to_owned())
    } else {
        Ok(())
    };
    let Some(()) = require(Requirement::Browser, found) else { return };
    node(&folder, "test.mjs");
}
