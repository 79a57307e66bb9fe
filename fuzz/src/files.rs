//! Inputs as files, for parsers that take paths.

use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder that lives as long as the thread; in memory where the system has such a place.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        let memory = Path::new("/dev/shm");
        let base = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
        Self(TempDir::with_prefix_in("noisefloor-fuzz-", base).expect("a folder for inputs"))
    }

    /// Writes a file, whose path it returns.
    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, bytes).expect("space for an input");
        path
    }
}
