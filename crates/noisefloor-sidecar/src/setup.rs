//! Installing renderers: private environments in the user's cache folder, and the host scripts.

use crate::error::SetupError;
use crate::renderer::Renderer;
use crate::run::run;
use etcetera::BaseStrategy;
use noisefloor::text::printable;
use serde::Deserialize;
use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// The Python module that host scripts import, as `host.py` beside them.
pub const HOST: &str = include_str!("../host/host.py");

/// Time limit for asking an interpreter for its version.
const VERSION_TIME: Duration = Duration::from_secs(30);
/// Time limit for loading a renderer: Blender from a cold disk takes a minute.
const PROBE_TIME: Duration = Duration::from_secs(300);
/// Time limit for one step of an installation: hundreds of megabytes over a slow line.
const STEP_TIME: Duration = Duration::from_secs(2 * 3600);
/// Lines of a failed step that are shown.
const SHOWN: usize = 20;

/// The interpreter that has a renderer: the one that its variable names ([`Renderer::variable`]), otherwise
/// that of the private environment. [`probe`] checks whether the renderer loads in it.
///
/// # Errors
/// [`SetupError::Missing`] if there is neither; [`SetupError::NoCache`].
pub fn find(renderer: &Renderer) -> Result<PathBuf, SetupError> {
    if let Some(python) = std::env::var_os(renderer.variable()).filter(|python| !python.is_empty()) {
        return Ok(python.into());
    }
    let python = python_in(&private_folder(renderer)?);
    if python.is_file() {
        return Ok(python);
    }
    let Renderer { title, name, .. } = *renderer;
    Err(SetupError::Missing { title, name, variable: renderer.variable() })
}

/// The version of the renderer in an interpreter. Loads the renderer, which takes seconds.
///
/// # Errors
/// [`SetupError::Broken`] with the interpreter's output.
pub fn probe(renderer: &Renderer, python: &Path) -> Result<String, SetupError> {
    let mut said = Said::default();
    let outcome = run(isolated(python, ["-c", renderer.probe]), PROBE_TIME, |line| said.push(line));
    let why = match outcome {
        Ok(status) if status.success() && !said.last().is_empty() => return Ok(said.last()),
        Ok(status) => format!("{status}; {}", said.text()),
        Err(error) => error.to_string(),
    };
    Err(SetupError::Broken { title: renderer.title, python: python.to_owned(), why })
}

/// The GPUs that a renderer could use in an interpreter, a line each, with the numbers by which a [`Device`](crate::Device) names
/// them; or one that says why there are none. Loads the renderer.
///
/// # Errors
/// [`SetupError::Broken`] with the interpreter's output.
pub fn gpus(renderer: &Renderer, python: &Path) -> Result<Vec<String>, SetupError> {
    let script = host_script(renderer)?;
    let mut command = Command::new(python);
    command.arg("-I").arg(script).arg("devices");
    let (mut said, mut listed) = (Said::default(), None);
    let outcome = run(command, PROBE_TIME, |line| {
        said.push(line);
        listed = line.strip_prefix(LISTED).map(str::to_owned).or_else(|| listed.take());
    });
    let broken = |why| SetupError::Broken { title: renderer.title, python: python.to_owned(), why };
    let status = outcome.map_err(|error| broken(error.to_string()))?;
    let found = listed.and_then(|json| serde_json::from_str::<Listed>(&json).ok());
    let Some(Listed { gpus, nowhere }) = found else {
        return Err(broken(format!("{status}; it lists no GPUs: {}", said.text())));
    };
    if gpus.is_empty() {
        return Ok(vec![format!("no GPU: {}", printable(&nowhere))]);
    }
    let line = |(number, (kind, name)): (usize, &(String, String))| {
        printable(&format!("GPU {number}: {name} ({kind})")).into_owned()
    };
    Ok(gpus.iter().enumerate().map(line).collect())
}

/// What begins the line of `HOST_SCRIPT devices`, as `host.py` says.
const LISTED: &str = "noisefloor GPUs: ";

#[derive(Deserialize)]
struct Listed {
    gpus: Vec<(String, String)>,
    nowhere: String,
}

/// The folder of a renderer's private environment, whether it exists or not. It depends on the requirements.
///
/// # Errors
/// [`SetupError::NoCache`].
pub fn private_folder(renderer: &Renderer) -> Result<PathBuf, SetupError> {
    Ok(cache()?.join(format!("{}-{}", renderer.name, digest(&[renderer.requirements]))))
}

/// Installs a renderer into its private environment, unless it is there and works: a virtual environment with
/// the pinned packages. The environment is made under a temporary name and moved into place once the renderer
/// loads in it. A second installation waits for the first. `progress` receives lines of text, including those
/// of pip. Returns the interpreter.
///
/// # Errors
/// [`SetupError`]: no suitable interpreter, no space, no network, a package that does not match its hash.
pub fn install(renderer: &Renderer, mut progress: impl FnMut(&str)) -> Result<PathBuf, SetupError> {
    let folder = private_folder(renderer)?;
    if let Ok(version) = probe(renderer, &python_in(&folder)) {
        progress(&format!("{} is already installed (version {version})", renderer.title));
        return Ok(python_in(&folder));
    }
    let base = interpreter(renderer)?;
    let cache = cache()?;
    fs::create_dir_all(&cache).map_err(io(&cache))?;
    let lock = cache.join(format!("{}.lock", renderer.name));
    // Unlocked when it is closed
    let alone = File::create(&lock).map_err(io(&lock))?;
    if alone.try_lock().is_err() {
        progress("waiting for another installation to finish");
        alone.lock().map_err(io(&lock))?;
    }
    // Another one may have finished it meanwhile, and its environment may be in use
    if python_in(&folder).is_file() && probe(renderer, &python_in(&folder)).is_ok() {
        progress("another installation has finished it");
        return Ok(python_in(&folder));
    }

    // Whoever holds the lock may remove what a killed installation has left
    let partial = cache.join(format!("{}.partial", renderer.name));
    for old in [&partial, &folder] {
        if old.exists() {
            fs::remove_dir_all(old).map_err(io(old))?;
        }
    }
    make_environment(renderer, &base, &partial, &mut progress)?;
    let version = probe(renderer, &python_in(&partial))?;
    fs::rename(&partial, &folder).map_err(io(&folder))?;
    progress(&format!("{} {version} is installed in {}", renderer.title, folder.display()));
    Ok(python_in(&folder))
}

/// A virtual environment with the pinned packages.
fn make_environment(
    renderer: &Renderer,
    base: &Path,
    folder: &Path,
    progress: &mut impl FnMut(&str),
) -> Result<(), SetupError> {
    let title = renderer.title;
    let mut step = |step: &'static str, command: Command| {
        let mut said = Said::default();
        let outcome = run(command, STEP_TIME, |line| {
            said.push(line);
            progress(line);
        });
        let said = match outcome {
            Ok(status) if status.success() => return Ok(()),
            Ok(status) => format!("{}\n{status}", said.text()),
            Err(error) => error.to_string(),
        };
        Err(SetupError::Step { title, step, said })
    };
    let mut venv = isolated(base, ["-m", "venv"]);
    venv.arg(folder);
    step("making a virtual environment (python -m venv)", venv)?;
    let requirements = folder.join("requirements.txt");
    fs::write(&requirements, renderer.requirements).map_err(io(&requirements))?;
    let quiet = ["--disable-pip-version-check", "--no-input", "--progress-bar", "off"];
    let mut pip = isolated(&python_in(folder), ["-m", "pip", "install", "--require-hashes"]);
    pip.args(["--only-binary", ":all:"]).args(quiet).arg("-r").arg(&requirements);
    step("installing the packages (pip install)", pip)
}

/// Puts the host script and `host.py` into the cache folder; the path of the script.
pub(crate) fn host_script(renderer: &Renderer) -> Result<PathBuf, SetupError> {
    let folder = cache()?.join("hosts").join(digest(&[HOST, renderer.script]));
    fs::create_dir_all(&folder).map_err(io(&folder))?;
    let script = folder.join(format!("{}_host.py", renderer.name));
    for (path, text) in [(&folder.join("host.py"), HOST), (&script, renderer.script)] {
        if fs::read(path).is_ok_and(|there| there == text.as_bytes()) {
            continue;
        }
        // Another process may be reading it: it appears complete
        let mut new = tempfile::NamedTempFile::new_in(&folder).map_err(io(&folder))?;
        new.write_all(text.as_bytes()).map_err(io(path))?;
        new.persist(path).map_err(|e| io(path)(e.error))?;
    }
    Ok(script)
}

/// The first interpreter on the path with a suitable version, best versions first.
fn interpreter(renderer: &Renderer) -> Result<PathBuf, SetupError> {
    let named = renderer.pythons.iter().map(|minor| format!("python3.{minor}"));
    let mut found = Vec::new();
    for python in named.chain(["python3".to_owned(), "python".to_owned()]) {
        let Some(version) = version(&python) else { continue };
        if renderer.pythons.iter().any(|minor| version.starts_with(&format!("3.{minor}."))) {
            return Ok(python.into());
        }
        found.push(version);
    }
    found.dedup();
    let wanted: Vec<String> = renderer.pythons.iter().map(|minor| format!("3.{minor}")).collect();
    let found = if found.is_empty() { "none".to_owned() } else { found.join(", ") };
    Err(SetupError::NoPython { title: renderer.title, wanted: wanted.join(" or "), found })
}

/// `3.11.7`, if it is an interpreter that runs.
fn version(python: &str) -> Option<String> {
    let mut said = Said::default();
    let question = "import platform; print(platform.python_version())";
    let status =
        run(isolated(Path::new(python), ["-c", question]), VERSION_TIME, |line| said.push(line)).ok()?;
    let version = said.last();
    (status.success() && version.starts_with("3.")).then_some(version)
}

fn isolated<const N: usize>(python: &Path, args: [&str; N]) -> Command {
    let mut command = Command::new(python);
    command.arg("-I").args(args);
    command
}

/// The interpreter of a virtual environment.
fn python_in(environment: &Path) -> PathBuf {
    environment.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" })
}

/// `noisefloor` in the user's cache folder.
fn cache() -> Result<PathBuf, SetupError> {
    let strategy = etcetera::choose_base_strategy().map_err(|e| SetupError::NoCache(e.to_string()))?;
    Ok(strategy.cache_dir().join("noisefloor"))
}

/// A short name that is unique to these texts.
fn digest(texts: &[&str]) -> String {
    let mut hasher = blake3::Hasher::new();
    for text in texts {
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
    }
    hasher.finalize().to_hex()[..12].to_owned()
}

fn io(path: &Path) -> impl FnOnce(std::io::Error) -> SetupError {
    let path = path.to_owned();
    move |source| SetupError::Io { path, source }
}

/// The last lines of a program's output.
#[derive(Default)]
struct Said(VecDeque<String>);

impl Said {
    fn push(&mut self, line: &str) {
        if line.trim().is_empty() {
            return;
        }
        if self.0.len() == SHOWN {
            self.0.pop_front();
        }
        self.0.push_back(line.to_owned());
    }

    fn last(&self) -> String {
        self.0.back().cloned().unwrap_or_default()
    }

    fn text(&self) -> String {
        Vec::from(self.0.clone()).join("\n")
    }
}
