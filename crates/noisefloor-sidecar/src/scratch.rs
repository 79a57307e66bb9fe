//! Scratch folders that are always removed.

use crate::leftovers;
use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::sync::Once;
use tempfile::TempDir;

const PREFIX: &str = "noisefloor-scratch-";
/// A file in each folder, locked as long as its process lives.
const LOCK: &str = "lock";

/// A folder in the system's temporary folder. Removed when dropped, by [`end_all`](crate::end_all), or, if
/// its process was killed, by the next process that makes one.
#[derive(Debug)]
pub(crate) struct Scratch {
    folder: TempDir,
    _lock: File,
}

impl Scratch {
    pub(crate) fn new() -> io::Result<Self> {
        let temporary = std::env::temp_dir();
        static SWEPT: Once = Once::new();
        SWEPT.call_once(|| sweep(&temporary));
        let folder = TempDir::with_prefix_in(PREFIX, &temporary)?;
        leftovers::add_folder(folder.path());
        let lock = File::create(folder.path().join(LOCK))?;
        // File systems without locks refuse; sweeping does nothing there either
        let _ = lock.try_lock();
        Ok(Self { folder, _lock: lock })
    }

    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        leftovers::remove_folder(self.folder.path());
    }
}

/// Removes folders whose lock nobody holds: the lock of a process ends with it, however it ends.
fn sweep(temporary: &Path) {
    // What cannot be listed, opened or removed is left; it does no harm.
    for entry in fs::read_dir(temporary).into_iter().flatten().flatten() {
        let ours = entry.file_name().to_str().is_some_and(|name| name.starts_with(PREFIX));
        if !ours || !entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            continue;
        }
        if let Ok(lock) = File::open(entry.path().join(LOCK))
            && lock.try_lock().is_ok()
        {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_of_the_dead_are_swept_and_those_of_the_living_are_not() {
        let temporary = tempfile::tempdir().unwrap();
        let make = |name: &str| {
            let folder = temporary.path().join(name);
            fs::create_dir(&folder).unwrap();
            fs::write(folder.join("picture.exr"), "half of it").unwrap();
            let lock = File::create(folder.join(LOCK)).unwrap();
            (folder, lock)
        };
        let (dead, _) = make("noisefloor-scratch-dead");
        let (alive, lock) = make("noisefloor-scratch-alive");
        let (foreign, _) = make("somebody-else");
        lock.lock().unwrap();
        sweep(temporary.path());
        assert!(!dead.exists() && alive.exists() && foreign.exists());
        let scratch = Scratch::new().unwrap();
        let path = scratch.path().to_owned();
        sweep(&std::env::temp_dir());
        assert!(path.exists());
        drop(scratch);
        assert!(!path.exists());
    }
}
