//! Tests that need something which not every machine has.

use std::ffi::OsStr;
use std::fmt::{self, Display};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Requirements that must be met here: words of [`Requirement`] with commas between them.
const REQUIRED: &str = "NOISEFLOOR_REQUIRE";
/// The folder of shared data, if it is not where [`require_shared`] looks for it.
const SHARED: &str = "NOISEFLOOR_SHARED";

/// What a test may need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Requirement {
    /// `renderers`: a renderer in another process, such as Mitsuba.
    Renderers,
    /// `llvm`: a libLLVM that Mitsuba can compile its kernels with.
    Llvm,
    /// `python`: a Python interpreter on the path, without any package.
    Python,
    /// `cmake`: CMake, pkg-config, and a compiler for C and C++ with its sanitizers.
    Cmake,
    /// `browser`: Chromium, and what it takes to drive it.
    Browser,
    /// `slurm`: the daemons of Slurm and Munge, and the right to start them.
    Slurm,
    /// `wasm`: Node, and the module that `crates/noisefloor-capi/js/build.sh` builds.
    Wasm,
    /// `shared`: data that are not part of the repository, such as what observers said.
    Shared,
}

impl Requirement {
    const ALL: [Self; 8] = [
        Self::Renderers,
        Self::Llvm,
        Self::Python,
        Self::Cmake,
        Self::Browser,
        Self::Slurm,
        Self::Wasm,
        Self::Shared,
    ];

    fn word(self) -> &'static str {
        match self {
            Self::Renderers => "renderers",
            Self::Llvm => "llvm",
            Self::Python => "python",
            Self::Cmake => "cmake",
            Self::Browser => "browser",
            Self::Slurm => "slurm",
            Self::Wasm => "wasm",
            Self::Shared => "shared",
        }
    }
}

impl Display for Requirement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// What a test needs, if it was found. If not, the test ought to return:
///
/// ```
/// use noisefloor_testkit::{Requirement, require};
/// # fn find_blender() -> Result<std::path::PathBuf, String> { Err("Blender is not installed".to_owned()) }
/// # fn a_test() {
/// let Some(blender) = require(Requirement::Renderers, find_blender()) else { return };
/// # let _ = blender;
/// # }
/// ```
///
/// A message that the test is skipped, with the reason, then goes to the standard error of the process. The
/// test harness does not capture it, so that it is seen although the test passes.
///
/// # Panics
/// If the environment variable `NOISEFLOOR_REQUIRE` names the requirement, and nothing was found: where
/// everything has been set up, a test that cannot run has failed. The variable holds words with commas
/// between them: `renderers`, `llvm`, `python`, `cmake`, `browser`, `slurm`, `wasm`, `shared`. Any other word is a
/// panic, too, since a misspelt one would require nothing.
pub fn require<T>(requirement: Requirement, found: Result<T, impl Display>) -> Option<T> {
    let required = is_required(requirement, std::env::var_os(REQUIRED).as_deref());
    match found {
        Ok(found) => Some(found),
        Err(reason) if required => panic!("{REQUIRED} names {requirement}, but {reason}"),
        Err(reason) => {
            // The harness names its threads after their tests
            let thread = std::thread::current();
            let test = thread.name().unwrap_or("a test");
            // Written at once, lest something come in between, and not by `eprintln!`, which would be
            // captured
            let message = format!("SKIPPED {test} (needs {requirement}): {reason}\n");
            std::io::stderr().write_all(message.as_bytes()).ok();
            None
        }
    }
}

fn is_required(requirement: Requirement, list: Option<&OsStr>) -> bool {
    let list = list.map(OsStr::to_string_lossy).unwrap_or_default();
    let words: Vec<&str> = list.split(',').map(str::trim).filter(|word| !word.is_empty()).collect();
    for word in &words {
        let known = Requirement::ALL.map(Requirement::word);
        assert!(known.contains(word), "{REQUIRED} names {word:?}, which is none of {known:?}");
    }
    words.contains(&requirement.word())
}

/// A Python interpreter, by [`require`]: `python3` on the path, or `python` on Windows.
///
/// # Panics
/// As [`require`].
pub fn require_python() -> Option<PathBuf> {
    let python = if cfg!(windows) { "python" } else { "python3" };
    let runs = Command::new(python).arg("-V").output().is_ok_and(|output| output.status.success());
    require(Requirement::Python, if runs { Ok(python.into()) } else { Err(format!("no {python} runs")) })
}

/// A file or folder of the shared data, by [`require`]. It is looked for in the folder that the environment
/// variable `NOISEFLOOR_SHARED` names. Without the variable, it is looked for in a folder `shared` in the
/// folder of the package that is tested, or in any folder around that one, the nearest first.
///
/// # Panics
/// As [`require`].
pub fn require_shared(path: impl AsRef<Path>) -> Option<PathBuf> {
    let path = path.as_ref();
    let named = std::env::var_os(SHARED).map(PathBuf::from);
    let package = std::env::current_dir().unwrap_or_default();
    let found = find_shared(path, named.as_deref(), &package).ok_or_else(|| match named {
        Some(folder) => format!("{} is not in {}, which {SHARED} names", path.display(), folder.display()),
        None => format!("{} is in no folder `shared` around here, and {SHARED} names none", path.display()),
    });
    require(Requirement::Shared, found)
}

fn find_shared(path: &Path, named: Option<&Path>, package: &Path) -> Option<PathBuf> {
    let there = |folder: PathBuf| Some(folder.join(path)).filter(|path| path.exists());
    match named {
        Some(folder) => there(folder.to_owned()),
        None => package.ancestors().find_map(|around| there(around.join("shared"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variable_says_what_is_required() {
        let required = |list: Option<&str>| {
            Requirement::ALL.into_iter().filter(|&r| is_required(r, list.map(OsStr::new))).collect::<Vec<_>>()
        };
        assert_eq!(required(None), []);
        assert_eq!(required(Some("")), []);
        assert_eq!(required(Some("shared, python")), [Requirement::Python, Requirement::Shared]);
        assert_eq!(required(Some("renderers,llvm,python,cmake,browser,slurm,wasm,shared")), Requirement::ALL);
    }

    #[test]
    #[should_panic(expected = "\"rendrers\", which is none of")]
    fn words_that_mean_nothing_are_refused() {
        is_required(Requirement::Python, Some(OsStr::new("python,rendrers")));
    }

    /// Not a test: [`what_is_missing_skips_a_test_or_fails_it`] runs it in a process of its own.
    #[test]
    #[ignore = "a part of another test"]
    fn needs_what_is_nowhere() {
        assert_eq!(require(Requirement::Browser, Err::<(), _>("there is none")), None);
    }

    #[test]
    fn what_is_missing_skips_a_test_or_fails_it() {
        let run = |required: &str| {
            let mut tests = Command::new(std::env::current_exe().expect("this program"));
            tests.args(["--exact", "requirement::tests::needs_what_is_nowhere", "--ignored"]);
            let output = tests.env(REQUIRED, required).output().expect("it runs");
            let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
            (output.status.success(), said)
        };
        // The harness captures what tests print, and shows it only for those that fail
        let (passed, said) = run("python");
        let message = "SKIPPED requirement::tests::needs_what_is_nowhere (needs browser): there is none";
        assert!(passed && said.contains("1 passed") && said.contains(message), "{said}");
        let (passed, said) = run("python,browser");
        let message = "NOISEFLOOR_REQUIRE names browser, but there is none";
        assert!(!passed && said.contains("1 failed") && said.contains(message), "{said}");
    }

    #[test]
    fn shared_data_are_found_around_the_package_or_where_the_variable_says() {
        let root = tempfile::tempdir().expect("a folder");
        let package = root.path().join("checkout/crates/one");
        let data = root.path().join("shared/human");
        let elsewhere = root.path().join("elsewhere");
        for folder in [&package, &data, &elsewhere] {
            std::fs::create_dir_all(folder).expect("a folder");
        }
        assert_eq!(find_shared("human".as_ref(), None, &package), Some(data));
        assert_eq!(find_shared("human/nothing-of-that-name".as_ref(), None, &package), None);
        assert_eq!(find_shared("human".as_ref(), Some(&elsewhere), &package), None);
        assert_eq!(find_shared("elsewhere".as_ref(), Some(root.path()), &package), Some(elsewhere));
    }
}
