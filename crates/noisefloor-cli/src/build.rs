//! This program, as a file: two builds may take other samples for one job.

use anyhow::Context;
use std::fs::File;
use std::path::PathBuf;
use std::sync::OnceLock;

/// This command, for other processes and nodes.
pub fn program() -> anyhow::Result<PathBuf> {
    std::env::current_exe().context("the path of this program")
}

/// BLAKE3 of this program, hexadecimal.
pub fn program_digest() -> anyhow::Result<String> {
    static DIGEST: OnceLock<String> = OnceLock::new();
    if let Some(digest) = DIGEST.get() {
        return Ok(digest.clone());
    }
    let path = program()?;
    let mut hasher = blake3::Hasher::new();
    let read = File::open(&path).and_then(|file| hasher.update_reader(file).map(|_| ()));
    read.with_context(|| path.display().to_string())?;
    Ok(DIGEST.get_or_init(|| hasher.finalize().to_hex().to_string()).clone())
}
