//! What would be left behind by a process that exits without running destructors.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Process groups that run, by their heads, and scratch folders in use.
#[derive(Default)]
struct Leftovers {
    groups: BTreeSet<u32>,
    folders: BTreeSet<PathBuf>,
}

static LEFTOVERS: Mutex<Leftovers> =
    Mutex::new(Leftovers { groups: BTreeSet::new(), folders: BTreeSet::new() });

fn leftovers() -> MutexGuard<'static, Leftovers> {
    LEFTOVERS.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(crate) fn add_group(head: u32) {
    leftovers().groups.insert(head);
}

pub(crate) fn remove_group(head: u32) {
    leftovers().groups.remove(&head);
}

pub(crate) fn add_folder(folder: &Path) {
    leftovers().folders.insert(folder.to_owned());
}

pub(crate) fn remove_folder(folder: &Path) {
    leftovers().folders.remove(folder);
}

/// Kills all renderers and programs that this process runs, with their descendants, and removes their scratch
/// folders.
///
/// [`std::process::exit`] runs no destructors: call this before it, for example when Ctrl-C is pressed a
/// second time. Sources that are still in use then fail. Not for use in a signal handler proper, since it
/// locks.
pub fn end_all() {
    let mut leftovers = leftovers();
    for head in std::mem::take(&mut leftovers.groups) {
        kill_group(head);
    }
    for folder in std::mem::take(&mut leftovers.folders) {
        // What cannot be removed now, the next run removes.
        let _ = std::fs::remove_dir_all(folder);
    }
}

/// Kills all processes of a group; elsewhere than on Unix there are none.
pub(crate) fn kill_group(head: u32) {
    #[cfg(unix)]
    if let Some(head) = i32::try_from(head).ok().and_then(rustix::process::Pid::from_raw) {
        // It may be empty already.
        let _ = rustix::process::kill_process_group(head, rustix::process::Signal::KILL);
    }
    #[cfg(not(unix))]
    let _ = head;
}
