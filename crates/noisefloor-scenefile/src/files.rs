//! Files that a scene file names, how much of them is read, and what was in them.

use crate::error::{LoadError, Place};
use noisefloor::SourceIdentity;
use std::cell::RefCell;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// Longest mesh or picture that is read, in bytes.
pub(crate) const MAX_FILE_BYTES: u64 = 1 << 28;
/// Most folders that a scene may add to those where its files are looked for.
const MAX_FOLDERS: u64 = 64;

/// Where the files are that a scene names. Nothing outside one folder is read.
#[derive(Debug)]
pub(crate) struct Folder {
    /// The folder that nothing may leave.
    root: PathBuf,
    /// The scene's own folder, and those that it adds.
    searched: Vec<PathBuf>,
    /// Digests of all files that were read.
    contents: RefCell<SourceIdentity>,
}

impl Folder {
    /// The folder that holds `scene`. Its files must lie in `root`, by default in that same folder.
    /// `options` are what changes the scene beside its files.
    pub(crate) fn of(scene: &Path, root: Option<&Path>, options: String) -> Self {
        let path = match scene.parent() {
            Some(parent) if parent != Path::new("") => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        let root = root.map_or_else(|| path.clone(), Path::to_owned);
        Self { root, searched: vec![path], contents: RefCell::new(SourceIdentity::new(options)) }
    }

    /// Adds a folder, relative to the scene's own, in which to look for files.
    ///
    /// # Errors
    /// As [`Self::find`].
    pub(crate) fn search(&mut self, name: &str, place: &Place) -> Result<(), LoadError> {
        place.clone().at_most("search paths", self.searched.len() as u64, MAX_FOLDERS)?;
        let path = self.find(name, place)?;
        self.searched.push(path);
        Ok(())
    }

    /// The file called `name` at `place`: the first there is, as seen from the scene's folder and those added
    /// to it. Backslashes separate folders, too.
    ///
    /// # Errors
    /// [`LoadError::Outside`] if the name, or a link on the way, leads out of the root; [`LoadError::Read`]
    /// if there is no such file.
    pub(crate) fn find(&self, name: &str, place: &Place) -> Result<PathBuf, LoadError> {
        let outside = || LoadError::Outside { place: place.clone(), name: name.to_owned() };
        let failed = |cause| LoadError::Read { place: place.clone(), cause };
        let name = name.trim().replace('\\', "/");
        let relative = Path::new(&name);

        // Names, whether or not the files exist
        let mut first_missing = None;
        for folder in &self.searched {
            if !self.stays_inside(folder, relative) {
                continue;
            }
            // Links
            let path = folder.join(relative);
            match path.canonicalize() {
                Ok(real) => {
                    let root = self.root.canonicalize().map_err(failed)?;
                    return if real.starts_with(root) { Ok(path) } else { Err(outside()) };
                }
                Err(cause) => first_missing = first_missing.or(Some((path, cause))),
            }
        }
        match first_missing {
            None => Err(outside()),
            Some((path, cause)) => {
                Err(failed(io::Error::new(cause.kind(), format!("`{}`: {cause}", path.display()))))
            }
        }
    }

    /// Reads a regular file of at most `limit` bytes that is named at `place`, and notes what is in it.
    pub(crate) fn read(&self, path: &Path, limit: u64, place: &Place) -> Result<Vec<u8>, LoadError> {
        let bytes = read(path, limit, place)?;
        // As seen from the scene, which may be moved with its files
        let name = path.strip_prefix(&self.searched[0]).unwrap_or(path).display().to_string();
        self.contents.borrow_mut().add(name, &bytes);
        Ok(bytes)
    }

    /// Digests of all files that were read.
    pub(crate) fn contents(&self) -> SourceIdentity {
        self.contents.borrow().clone()
    }

    /// Whether `name`, seen from `folder`, stays below the root, judged by the names alone.
    fn stays_inside(&self, folder: &Path, name: &Path) -> bool {
        // How far the folder is below the root
        let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let inside = real(folder).strip_prefix(real(&self.root)).ok().map(|path| path.components().count());
        let mut depth = inside.unwrap_or(0);
        for component in name.components() {
            match component {
                Component::Normal(_) => depth += 1,
                Component::CurDir => {}
                Component::ParentDir => match depth.checked_sub(1) {
                    Some(up) => depth = up,
                    None => return false,
                },
                Component::Prefix(_) | Component::RootDir => return false,
            }
        }
        true
    }
}

/// Reads a regular file.
fn read(path: &Path, limit: u64, place: &Place) -> Result<Vec<u8>, LoadError> {
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

    // A file that grows while it is read is cut off
    let mut bytes = Vec::new();
    File::open(path).and_then(|file| file.take(limit).read_to_end(&mut bytes)).map_err(failed)?;
    Ok(bytes)
}
