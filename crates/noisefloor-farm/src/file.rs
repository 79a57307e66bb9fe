//! Files of a farm: JSON that can be read back, and nothing that blocks.

use crate::error::FarmError;
use noisefloor_image::write_atomic;
use serde::{Serialize, de::DeserializeOwned};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::Path;

/// Longest file of JSON that is written and read: a round of some ten million batches.
const MAX_JSON: u64 = 1 << 30;

/// Opens a file for reading, unless it is a pipe or a device: these might block, or never end.
pub(crate) fn open_regular(path: &Path) -> io::Result<File> {
    if !fs::metadata(path)?.is_file() {
        let what = "it is a folder, a pipe or a device, and not a file";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    }
    File::open(path)
}

/// What a file holds; none if there is no such file.
pub(crate) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, FarmError> {
    let failed = |fault: io::Error| FarmError::at(path, fault);
    let file = match open_regular(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(failed(error)),
    };
    let mut text = Vec::new();
    file.take(MAX_JSON).read_to_end(&mut text).map_err(failed)?;
    serde_json::from_slice(&text).map(Some).map_err(|fault| FarmError::at(path, fault))
}

pub(crate) fn write_json<T: Serialize>(path: &Path, content: &T) -> Result<(), FarmError> {
    Ok(write_atomic(path, |to| {
        let mut to = UpTo { to, left: MAX_JSON };
        serde_json::to_writer(&mut to, content).map_err(io::Error::from).and_then(|()| to.write_all(b"\n"))
    })?)
}

/// Writes no more than can be read back.
struct UpTo<W> {
    to: W,
    left: u64,
}

impl<W: Write> Write for UpTo<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let Some(left) = self.left.checked_sub(bytes.len() as u64) else {
            let what = "it would be too long to be read back: render fewer frames in one farm";
            return Err(io::Error::new(io::ErrorKind::FileTooLarge, what));
        };
        let written = self.to.write(bytes)?;
        self.left = left + (bytes.len() - written) as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_could_not_be_read_back_is_not_written() {
        let mut text = Vec::new();
        let mut to = UpTo { to: &mut text, left: 4 };
        to.write_all(b"ab").unwrap();
        assert_eq!(to.write_all(b"cde").unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        to.write_all(b"cd").unwrap();
        assert_eq!(text, b"abcd");
    }
}
