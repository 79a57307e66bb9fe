//! Inputs as files, for parsers that take paths, and the frame around those with a checksum.

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

/// Magic and version.
pub(crate) const HEAD: usize = 12;
/// Magic, version, length and checksum.
pub(crate) const HEADER: usize = HEAD + 8 + 32;

/// Content behind the magic and version of another file, with its length and checksum.
pub(crate) fn framed(other: &[u8], content: &[u8]) -> Vec<u8> {
    let length = (content.len() as u64).to_le_bytes();
    [&other[..HEAD], &length, blake3::hash(content).as_bytes(), content].concat()
}

/// The content that is framed so.
pub(crate) fn content(whole: &[u8]) -> &[u8] {
    let length = u64::from_le_bytes(whole[HEAD..HEAD + 8].try_into().expect("eight bytes"));
    &whole[HEADER..][..length as usize]
}
