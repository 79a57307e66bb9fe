//! Output folders: one run at a time, and nothing overwritten that was not meant to be.

use crate::say::note;
use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use std::fs::{File, OpenOptions, TryLockError};
use std::path::{Component, Path, PathBuf};

/// What a run does about the work of an earlier one in its output folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Earlier {
    /// It is an error that there is any.
    Keep,
    Overwrite,
    Resume,
}

impl Earlier {
    pub fn of(force: bool, resume: bool) -> Self {
        match (force, resume) {
            (true, _) => Self::Overwrite,
            (false, true) => Self::Resume,
            (false, false) => Self::Keep,
        }
    }
}

/// The lock on an output folder. It stays an empty hidden file; the lock itself ends with the process,
/// however that ends.
const LOCK: &str = ".noisefloor.lock";

/// A name in a path that Windows keeps for a device, whatever its ending, or that it would cut short.
fn reserved(path: &Path) -> Option<String> {
    path.components()
        .filter_map(|name| if let Component::Normal(name) = name { name.to_str() } else { None })
        .find_map(|name| {
            let stem = name.split('.').next().unwrap_or_default().trim_end().to_ascii_uppercase();
            let port = ["COM", "LPT"].iter().find_map(|kind| stem.strip_prefix(kind));
            let is_port =
                port.is_some_and(|port| port.len() == 1 && ('1'..='9').any(|digit| port.starts_with(digit)));
            let is_device = is_port || matches!(stem.as_str(), "CON" | "PRN" | "AUX" | "NUL");
            (is_device || name.ends_with(['.', ' '])).then(|| name.to_owned())
        })
}

/// An output folder that no other run writes into as long as this value lives.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    _lock: File,
}

impl Folder {
    /// Makes the folder, and locks it.
    pub fn claim(path: PathBuf) -> anyhow::Result<Self> {
        if let Some(name) = reserved(&path).filter(|_| cfg!(windows)) {
            bail!("{}: Windows keeps the name {name} for itself; choose another with --out", path.display());
        }
        std::fs::create_dir_all(&path).with_context(|| {
            format!("{}: this folder cannot be made; choose another with --out", path.display())
        })?;
        let lock = OpenOptions::new().create(true).truncate(false).write(true).open(path.join(LOCK));
        let lock = lock.with_context(|| {
            format!("{}: no files can be made in this folder; choose another with --out", path.display())
        })?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => bail!(
                "{}: another noisefloor is writing into this folder; wait for it, \
                 or choose another with --out",
                path.display()
            ),
            // File systems without locks are rare, and no reason not to render
            Err(TryLockError::Error(error)) => {
                note!("warning: {}: not locked against other runs: {error}", path.display());
            }
        }
        Ok(Self { path, _lock: lock })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The first of these files that the folder has.
    pub fn first_of<'a>(&self, names: &[&'a str]) -> Option<&'a str> {
        names.iter().copied().find(|name| self.path.join(name).exists())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_windows_keeps_are_known() {
        for name in ["out/aux", "CON.exr/a", "shots/lpt9.0001", "nul .txt", "out/hall.", "hall "] {
            assert!(reserved(Path::new(name)).is_some(), "{name}");
        }
        for name in ["out/auxiliary", "../console", "com0", "com10", "lpt", "./.hidden", "prn-2", "COMET"] {
            assert_eq!(reserved(Path::new(name)), None, "{name}");
        }
    }
}
