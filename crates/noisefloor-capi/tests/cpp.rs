//! The header in C, found by pkg-config, and the example in C++, found by CMake and run under sanitizers and
//! valgrind. A package has no such test, since the example is not in it.

use noisefloor_testkit::{Requirement, require};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Runs a program to its end, and returns what it printed. What it says beside must not be a warning of a session.
fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success(), "{command:?}: {}\n{out}\n{err}", output.status);
    assert!(!err.contains("warning: "), "{err}");
    out
}

/// The tools, or which is missing.
fn tools() -> Result<(), String> {
    for tool in ["cmake", "pkg-config", "c++", "make", "valgrind"] {
        let runs = Command::new(tool).arg("--version").output().is_ok_and(|output| output.status.success());
        if !runs {
            return Err(format!("no {tool} runs"));
        }
    }
    Ok(())
}

fn package() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Installs the libraries that cargo has built beside this test, and moves all to where it is used, as packagers
/// do.
fn install(folder: &Path) -> PathBuf {
    let (staged, prefix) = (folder.join("staged"), folder.join("installed"));
    let test = std::env::current_exe().expect("a test knows its path");
    let built = test.parent().expect("a program lies in a folder");
    run(Command::new(package().join("install.sh")).arg(&staged).arg(built));
    std::fs::rename(staged, &prefix).expect("a folder can be renamed");
    prefix
}

/// Builds the example against an installation.
fn build(folder: &Path, prefix: &Path, options: &[&str]) -> PathBuf {
    let build = folder.join("build");
    let source = package().join("../../examples/7-cpp-path-tracer");
    let mut configure = Command::new("cmake");
    configure.arg(format!("-DCMAKE_PREFIX_PATH={}", prefix.display())).args(options);
    run(configure.arg("-S").arg(source).arg("-B").arg(&build));
    run(Command::new("cmake").arg("--build").arg(&build));
    build.join("path-tracer")
}

/// What the example printed: each tile, and a mean that is not the limit of all of them.
fn check_report(report: &str) {
    let lines: Vec<&str> = report.lines().collect();
    assert_eq!(lines.len(), 4 * 2 + 1, "{report}");
    assert!(lines[..8].iter().all(|line| line.starts_with("tile ") && line.contains(", P = ")), "{report}");
    assert!(lines[..8].iter().any(|line| line.contains("converged")), "{report}");
    assert!(lines[8].ends_with("samples per pixel on average"), "{report}");
}

#[test]
fn cpp_threads_push_tiles_under_sanitizers() {
    let Some(()) = require(Requirement::Cmake, tools()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let prefix = install(folder.path());
    let program = build(folder.path(), &prefix, &["-DSANITIZE=ON"]);
    let picture = folder.path().join("picture.pfm");
    let report = run(Command::new(program).args(["256", "100"]).arg(&picture));
    check_report(&report);
    assert_eq!(
        std::fs::metadata(picture).unwrap().len(),
        3 * 4 * 256 * 100 + "PF\n256 100\n-1\n".len() as u64
    );
}

#[test]
fn the_static_library_leaks_and_overruns_nothing_under_valgrind() {
    let Some(()) = require(Requirement::Cmake, tools()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let prefix = install(folder.path());
    let program = build(folder.path(), &prefix, &["-DSTATIC=ON"]);
    // What the thread pool keeps until the end is still reachable, and no leak
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--quiet", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=definite"]);
    let report = run(valgrind.arg(program).args(["32", "32"]));
    assert!(report.contains("samples per pixel on average"), "{report}");
}

#[test]
fn the_header_is_plain_c() {
    let Some(()) = require(Requirement::Cmake, tools()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("plain.c");
    let program = "#include <noisefloor.h>\nint main(void) { return nf_version()[0] == 0; }\n";
    std::fs::write(&source, program).unwrap();
    let prefix = install(folder.path());
    let binary = folder.path().join("plain");
    let strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror"];
    // By the recipe of the README, from an empty folder
    let lib = prefix.join("lib");
    let mut asked = Command::new("pkg-config");
    asked.env("PKG_CONFIG_PATH", lib.join("pkgconfig")).args(["--cflags", "--libs", "noisefloor"]);
    let flags = run(&mut asked);
    let mut compiler = Command::new("cc");
    compiler.args(strict).arg(source).args(flags.split_whitespace());
    run(compiler.arg(format!("-Wl,-rpath,{}", lib.display())).arg("-o").arg(&binary));
    run(&mut Command::new(binary));
}
