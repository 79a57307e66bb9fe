//! Setting renderers up: private environments in the user's cache folder, and the scripts of the hosts.

use crate::error::SetupError;
use crate::renderer::Renderer;
use crate::run::run;
use etcetera::BaseStrategy;
use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// The Python module that host scripts import, as `host.py` beside them.
pub const HOST: &str = include_str!("../host/host.py");

/// Time for the question which version an interpreter is.
const VERSION_TIME: Duration = Duration::from_secs(30);
/// Time for loading a renderer: Blender from a cold disk takes a minute.
const PROBE_TIME: Duration = Duration::from_secs(300);
/// Time for one step of an installation: hundreds of megabytes over a slow line.
const STEP_TIME: Duration = Duration::from_secs(2 * 3600);
/// Lines of a failed step that are shown.
const SHOWN: usize = 20;

/// The interpreter that has a renderer: the one that its variable names ([`Renderer::variable`]), else that of the private environment.
/// Whether the renderer loads in it, [`probe`] says.
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

/// The version of a renderer as the interpreter has it. Loads the renderer, which takes seconds.
///
/// # Errors
/// [`SetupError::Broken`] with what the interpreter said.
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

/// The folder of a renderer's private environment, whether it is there or not. Other requirements, another folder.
///
/// # Errors
/// [`SetupError::NoCache`].
pub fn private_folder(renderer: &Renderer) -> Result<PathBuf, SetupError> {
    Ok(cache()?.join(format!("{}-{}", renderer.name, digest(&[renderer.requirements]))))
}

/// Makes the private environment of a renderer, unless it is there and works: a virtual environment with the pinned packages. It is made under
/// a temporary name and moved into place once the renderer loads in it; a second installation waits for the first. `progress` gets
/// a line at a time, those of pip among them. Returns the interpreter.
///
/// # Errors
/// [`SetupError`]: no interpreter of a version that will do, no space, no network, a package that is not what was pinned.
pub fn install(renderer: &Renderer, mut progress: impl FnMut(&str)) -> Result<PathBuf, SetupError> {
    let folder = private_folder(renderer)?;
    if let Ok(version) = probe(renderer, &python_in(&folder)) {
        progress(&format!("{} is there already (it says {version})", renderer.title));
        return Ok(python_in(&folder));
    }
    let base = interpreter(renderer)?;
    let cache = cache()?;
    fs::create_dir_all(&cache).map_err(io(&cache))?;
    let lock = cache.join(format!("{}.lock", renderer.name));
    // Unlocked when it is closed
    let alone = File::create(&lock).map_err(io(&lock))?;
    if alone.try_lock().is_err() {
        progress("waiting for another installation to end");
        alone.lock().map_err(io(&lock))?;
    }
    // Another one may have done it meanwhile, and its environment may be in use.
    if python_in(&folder).is_file() && probe(renderer, &python_in(&folder)).is_ok() {
        progress("another installation has done it");
        return Ok(python_in(&folder));
    }

    // Whoever holds the lock may clear away what an installation that was killed has left.
    let partial = cache.join(format!("{}.partial", renderer.name));
    for old in [&partial, &folder] {
        if old.exists() {
            fs::remove_dir_all(old).map_err(io(old))?;
        }
    }
    let title = renderer.title;
    let mut step = |what: &'static str, command: Command| {
        let mut said = Said::default();
        let outcome = run(command, STEP_TIME, |line| {
            said.push(line);
            progress(line);
        });
        match outcome {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => {
                Err(SetupError::Step { title, step: what, said: format!("{}\n{status}", said.text()) })
            }
            Err(error) => Err(SetupError::Step { title, step: what, said: error.to_string() }),
        }
    };
    let mut venv = isolated(&base, ["-m", "venv"]);
    venv.arg(&partial);
    step("making a virtual environment (python -m venv)", venv)?;
    let requirements = partial.join("requirements.txt");
    fs::write(&requirements, renderer.requirements).map_err(io(&requirements))?;
    let quiet = ["--disable-pip-version-check", "--no-input", "--progress-bar", "off"];
    let mut pip = isolated(&python_in(&partial), ["-m", "pip", "install", "--require-hashes"]);
    pip.args(["--only-binary", ":all:"]).args(quiet).arg("-r").arg(&requirements);
    step("installing the packages (pip install)", pip)?;

    let version = probe(renderer, &python_in(&partial))?;
    fs::rename(&partial, &folder).map_err(io(&folder))?;
    progress(&format!("{title} is there (it says {version}), in {}", folder.display()));
    Ok(python_in(&folder))
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
        // Another process may be reading it: it appears whole.
        let mut new = tempfile::NamedTempFile::new_in(&folder).map_err(io(&folder))?;
        new.write_all(text.as_bytes()).map_err(io(path))?;
        new.persist(path).map_err(|e| io(path)(e.error))?;
    }
    Ok(script)
}

/// An interpreter on the path of a version that will do, the best first.
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

/// `3.11.7`, if that is an interpreter that runs.
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

/// A short name for these texts and no others.
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

/// The last lines that a program said.
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
