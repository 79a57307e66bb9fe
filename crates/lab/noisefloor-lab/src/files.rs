//! JSON and text, each file whole or not at all.

use crate::error::LabError;
use noisefloor_image::{WriteError, write_atomic};
use serde::Serialize;
use std::io::Write;
use std::path::Path;

pub(crate) fn write_json(path: &Path, value: &impl Serialize) -> Result<(), WriteError> {
    write_atomic(path, |to| serde_json::to_writer_pretty(to, value))
}

pub(crate) fn write_text(path: &Path, text: &str) -> Result<(), WriteError> {
    write_atomic(path, |to| to.write_all(text.as_bytes()))
}

pub(crate) fn make_folder(path: &Path) -> Result<(), LabError> {
    std::fs::create_dir_all(path).map_err(|source| LabError::Folder { path: path.to_owned(), source })
}
