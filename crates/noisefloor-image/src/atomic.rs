//! Files that appear complete or not at all, even if the power fails.

use crate::error::{WriteError, WriteFault};
use std::collections::BTreeSet;
use std::error::Error;
use std::fs::{self, File, TryLockError};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use tempfile::NamedTempFile;

/// Temporary files are named `.noisefloor-XXXXXX.tmp`.
const PREFIX: &str = ".noisefloor-";
const SUFFIX: &str = ".tmp";
/// How often a temporary file is made anew if another process swept it away before it was locked.
const ATTEMPTS: usize = 16;

/// Writes a file through a temporary one in the same folder, which takes the file's name once it is complete
/// and on disk.
///
/// On failure, or if the process is killed, an existing file stays as it was. If the power fails after this
/// has returned, the new file is there: file and folder are both synchronised. A killed process may leave a
/// hidden `.noisefloor-*.tmp` behind; the next process that writes into the folder removes it. A symbolic
/// link stays, and the file it points to is replaced. The writer is buffered, can seek, and is flushed on
/// return.
///
/// ```
/// use std::io::Write;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("stops.csv");
/// noisefloor_image::write_atomic(&path, |writer| writeln!(writer, "tile,spp"))?;
/// assert_eq!(std::fs::read_to_string(path)?, "tile,spp\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`WriteFault::Folder`] if the folder does not exist or is not writable, [`WriteFault::NotAFile`] if the
/// path is a folder or a device, [`WriteFault::Failed`] with the cause if `write` failed or the disk is full.
pub fn write_atomic<E>(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<(), WriteError>
where
    E: Into<Box<dyn Error + Send + Sync>>,
{
    write_through(&System, path.as_ref(), write)
}

/// Checks that a file could be written, for commands that would otherwise fail after hours of work. Writes
/// nothing.
///
/// # Errors
/// Those of [`write_atomic`].
pub fn check_writable(path: impl AsRef<Path>) -> Result<(), WriteError> {
    Place::find(path.as_ref()).and_then(|place| place.temporary()).map(drop)
}

/// The steps whose order decides what is left after a power failure; tests record them.
trait Disk {
    fn sync_file(&self, file: &File) -> io::Result<()>;
    fn rename(&self, file: NamedTempFile, to: &Path) -> io::Result<()>;
    fn sync_folder(&self, folder: &Path) -> io::Result<()>;
}

struct System;

impl Disk for System {
    fn sync_file(&self, file: &File) -> io::Result<()> {
        file.sync_all()
    }

    fn rename(&self, file: NamedTempFile, to: &Path) -> io::Result<()> {
        file.persist(to).map(drop).map_err(|error| error.error)
    }

    /// A new name is on disk once its folder is. Windows opens no folders, and writes names through by
    /// itself.
    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
    }
}

fn write_through<E>(
    disk: &impl Disk,
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<(), WriteError>
where
    E: Into<Box<dyn Error + Send + Sync>>,
{
    let failed = |source: Box<dyn Error + Send + Sync>| WriteFault::Failed(source).of(path);
    let place = Place::find(path)?;

    // Write beside it
    let mut temporary = place.temporary()?;
    let mut writer = BufWriter::new(temporary.as_file_mut());
    write(&mut writer).map_err(|e| failed(e.into()))?;
    writer.flush().map_err(|e| failed(e.into()))?;
    drop(writer);

    // Content first, then the name, then the folder that holds the name
    disk.sync_file(temporary.as_file()).map_err(|e| failed(e.into()))?;
    disk.rename(temporary, &place.target).map_err(|e| failed(e.into()))?;
    disk.sync_folder(&place.folder).map_err(|e| failed(e.into()))
}

/// Where a file is to go.
struct Place<'a> {
    path: &'a Path,
    /// Behind symbolic links.
    target: PathBuf,
    folder: PathBuf,
}

impl<'a> Place<'a> {
    /// Refuses to replace a folder or a device.
    fn find(path: &'a Path) -> Result<Self, WriteError> {
        let failed = |e: io::Error| WriteFault::Failed(e.into()).of(path);
        let target = match fs::metadata(path) {
            Ok(meta) if meta.is_file() => fs::canonicalize(path).map_err(failed)?,
            Ok(_) => return Err(WriteFault::NotAFile.of(path)),
            Err(_) => path.to_owned(),
        };
        if target.file_name().is_none() {
            return Err(WriteFault::NotAFile.of(path));
        }
        let folder = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        Ok(Self { path, target, folder })
    }

    /// A temporary file in the folder, locked as long as it is open, so that nobody sweeps it away.
    fn temporary(&self) -> Result<NamedTempFile, WriteError> {
        sweep_once(&self.folder);
        let refused = |source| WriteFault::Folder { folder: self.folder.clone(), source }.of(self.path);
        let mut builder = tempfile::Builder::new();
        builder.prefix(PREFIX).suffix(SUFFIX);
        #[cfg(unix)]
        {
            // As any new file: what the umask leaves, where temporary files usually are their owner's only
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        for _ in 0..ATTEMPTS {
            let file = builder.tempfile_in(&self.folder).map_err(refused)?;
            // Locked by somebody else, or gone: another process is sweeping it away. File systems without
            // locks are not swept.
            let swept = matches!(file.as_file().try_lock(), Err(TryLockError::WouldBlock));
            if !swept && file.path().exists() {
                return Ok(file);
            }
        }
        Err(refused(io::Error::other("another process keeps removing temporary files")))
    }
}

/// Removes the temporary files of killed processes from a folder, the first time that this process writes
/// into it.
fn sweep_once(folder: &Path) {
    static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    let first = SWEPT.lock().unwrap_or_else(PoisonError::into_inner).insert(folder.to_owned());
    if first {
        sweep(folder);
    }
}

/// A temporary file that can be locked belongs to nobody: the lock of a process ends with it, however it
/// ends.
fn sweep(folder: &Path) {
    // What cannot be listed, opened or removed is left; it does no harm.
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let ours = name.to_str().is_some_and(|name| name.starts_with(PREFIX) && name.ends_with(SUFFIX));
        if !ours || !entry.file_type().is_ok_and(|kind| kind.is_file()) {
            continue;
        }
        if let Ok(file) = File::open(entry.path())
            && file.try_lock().is_ok()
        {
            let _ = fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    /// Does what the system does, and writes the steps down; fails at one of them.
    #[derive(Default)]
    struct Recorder {
        steps: RefCell<Vec<&'static str>>,
        fails: Option<&'static str>,
    }

    impl Recorder {
        fn note(&self, step: &'static str) -> io::Result<()> {
            self.steps.borrow_mut().push(step);
            if self.fails == Some(step) { Err(io::Error::other("no space left")) } else { Ok(()) }
        }
    }

    impl Disk for Recorder {
        fn sync_file(&self, file: &File) -> io::Result<()> {
            assert_eq!(file.metadata()?.len(), 3, "synchronised before it was flushed");
            self.note("sync file").and_then(|()| System.sync_file(file))
        }

        fn rename(&self, file: NamedTempFile, to: &Path) -> io::Result<()> {
            self.note("rename").and_then(|()| System.rename(file, to))
        }

        fn sync_folder(&self, folder: &Path) -> io::Result<()> {
            self.note("sync folder").and_then(|()| System.sync_folder(folder))
        }
    }

    fn write(disk: &Recorder, path: &Path) -> Result<(), WriteError> {
        write_through(disk, path, |writer| writer.write_all(b"new"))
    }

    /// The order that survives a power failure: content, name, folder. Whatever fails, nothing is left beside
    /// the file.
    #[test]
    fn content_is_on_disk_before_the_name_and_the_name_before_the_return() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let disk = Recorder::default();
        write(&disk, &path).unwrap();
        assert_eq!(*disk.steps.borrow(), ["sync file", "rename", "sync folder"]);

        for (fails, there) in [("sync file", "old"), ("rename", "old"), ("sync folder", "new")] {
            fs::write(&path, "old").unwrap();
            let disk = Recorder { fails: Some(fails), ..Recorder::default() };
            assert!(matches!(write(&disk, &path).unwrap_err().fault, WriteFault::Failed(_)), "{fails}");
            assert_eq!(disk.steps.borrow().last(), Some(&fails));
            assert_eq!(fs::read_to_string(&path).unwrap(), there, "{fails}");
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "{fails}");
        }
    }

    #[test]
    fn temporary_files_of_the_dead_are_swept_and_those_of_the_living_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let (dead, alive) = (folder.path().join(".noisefloor-dead.tmp"), folder.path().join("a"));
        fs::write(&dead, "half of it").unwrap();
        fs::write(folder.path().join("noisefloor.tmp"), "somebody else's").unwrap();
        let place = Place::find(&alive).unwrap();
        let living = place.temporary().unwrap();
        assert!(!dead.exists());
        sweep(folder.path());
        assert!(living.path().exists() && folder.path().join("noisefloor.tmp").exists());
        let left = living.into_temp_path().keep().unwrap();
        sweep(folder.path());
        assert!(!left.exists());
    }
}
