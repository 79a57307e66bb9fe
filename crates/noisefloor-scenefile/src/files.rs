//! Files that a scene file names, and how much of them is read.

use crate::error::{LoadError, Place};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// Longest mesh or picture that is read, in bytes.
pub(crate) const MAX_FILE_BYTES: u64 = 1 << 28;

/// The folder of a scene file. Nothing outside it is read.
#[derive(Debug)]
pub(crate) struct Folder {
    path: PathBuf,
}

impl Folder {
    /// The folder that holds `scene`.
    pub(crate) fn of(scene: &Path) -> Self {
        let path = match scene.parent() {
            Some(parent) if parent != Path::new("") => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        Self { path }
    }

    /// The file called `name` at `place`.
    ///
    /// # Errors
    /// [`LoadError::Outside`] if the name, or a link on the way, leads out of the folder; [`LoadError::Read`]
    /// if there is no such file.
    pub(crate) fn find(&self, name: &str, place: &Place) -> Result<PathBuf, LoadError> {
        let outside = || LoadError::Outside { place: place.clone(), name: name.to_owned() };
        let read = |cause| LoadError::Read { place: place.clone(), cause };

        // Names, whether or not the files exist
        let mut depth = 0u32;
        for component in Path::new(name).components() {
            match component {
                Component::Normal(_) => depth += 1,
                Component::CurDir => {}
                Component::ParentDir => depth = depth.checked_sub(1).ok_or_else(outside)?,
                Component::Prefix(_) | Component::RootDir => return Err(outside()),
            }
        }

        // Links
        let path = self.path.join(name);
        let missing =
            |cause: io::Error| read(io::Error::new(cause.kind(), format!("`{}`: {cause}", path.display())));
        let real = path.canonicalize().map_err(missing)?;
        let folder = self.path.canonicalize().map_err(missing)?;
        if real.starts_with(folder) { Ok(path) } else { Err(outside()) }
    }
}

/// Reads a regular file of at most `limit` bytes that is named at `place`.
pub(crate) fn read(path: &Path, limit: u64, place: &Place) -> Result<Vec<u8>, LoadError> {
    let failed = |cause: io::Error| {
        let cause = io::Error::new(cause.kind(), format!("`{}`: {cause}", path.display()));
        LoadError::Read { place: place.clone(), cause }
    };

    // A pipe or a device would block or never end
    let meta = std::fs::metadata(path).map_err(failed)?;
    if !meta.is_file() {
        return Err(failed(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file")));
    }
    Place::file(path).at_most("bytes", meta.len(), limit)?;

    // A file that grows meanwhile is cut
    let mut bytes = Vec::new();
    File::open(path).and_then(|file| file.take(limit).read_to_end(&mut bytes)).map_err(failed)?;
    Ok(bytes)
}
