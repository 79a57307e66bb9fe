//! Checkpoints in files and in memory.

use crate::border;
use crate::handle;
use crate::session::NfSession;
use crate::status::{Failure, NfStatus, guard};
use noisefloor::{Checkpoint, Session};
use std::ffi::c_char;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;
use tempfile::NamedTempFile;

/// Bytes of a pixel of a session.
const FILM: usize = 36;

/// Writes a snapshot of the session, for resuming it. The file is whole or not there. job is text that names
/// all the samples depend on: scene, seed, options of the renderer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_save(
    session: *const NfSession,
    job: *const c_char,
    path: *const c_char,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        // SAFETY: promised by the caller.
        let job = unsafe { border::text(job, "job") }?;
        // SAFETY: promised by the caller.
        let path = Path::new(unsafe { border::text(path, "path") }?);
        let failed = |error: io::Error| Failure::new(NfStatus::Io, format!("{}: {error}", path.display()));

        // A file beside it takes its place once it is complete
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let mut file = NamedTempFile::new_in(folder.unwrap_or(Path::new("."))).map_err(failed)?;
        // No buffer: what is left in one when it is dropped fails without a word
        session.lock()?.checkpoint(job)?.write(&mut file)?;
        file.as_file().sync_all().map_err(failed)?;
        file.persist(path).map_err(|error| failed(error.error))?;
        Ok(())
    })
}

/// Puts a session back where nf_session_save found it. The session must have been made with the same size,
/// parameters and oracle, and job must be the same. If the renderer repeats its samples, all that follows is
/// the same to the bit as without the interruption, warnings included. Pixels share samples if either
/// session was told so by nf_session_share_pixels. On failure the session is as it was.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_resume(
    session: *const NfSession,
    job: *const c_char,
    path: *const c_char,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        // SAFETY: promised by the caller.
        let job = unsafe { border::text(job, "job") }?;
        // SAFETY: promised by the caller.
        let path = unsafe { border::text(path, "path") }?;
        let file = File::open(path).map_err(|e| Failure::new(NfStatus::Io, format!("{path}: {e}")))?;
        resume(&session, job, BufReader::new(file))
    })
}

/// As nf_session_save, into memory instead of a file: size becomes the number of bytes. bytes has room for
/// capacity; if it is NULL, only size is written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_checkpoint(
    session: *const NfSession,
    job: *const c_char,
    bytes: *mut u8,
    capacity: usize,
    size: *mut usize,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        // SAFETY: promised by the caller.
        let job = unsafe { border::text(job, "job") }?;
        border::memory(session.grid, FILM)?;
        let mut written = Vec::new();
        session.lock()?.checkpoint(job)?.write(&mut written)?;
        if !bytes.is_null() {
            // SAFETY: promised by the caller.
            unsafe { border::room(bytes, capacity, written.len(), "bytes") }?.copy_from_slice(&written);
        }
        // SAFETY: promised by the caller.
        unsafe { border::write(size, written.len(), "size") }
    })
}

/// As nf_session_resume, from the bytes of nf_session_checkpoint or of a file of nf_session_save.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_session_restore(
    session: *const NfSession,
    job: *const c_char,
    bytes: *const u8,
    size: usize,
) -> NfStatus {
    guard(|| {
        let session = handle::get(session)?;
        // SAFETY: promised by the caller.
        let job = unsafe { border::text(job, "job") }?;
        // SAFETY: promised by the caller.
        resume(&session, job, unsafe { border::array(bytes, size, size, "bytes") }?)
    })
}

fn resume(session: &NfSession, job: &str, from: impl Read) -> Result<(), Failure> {
    // The film that is read, and the one that it is checked against
    border::memory(session.grid, 2 * FILM)?;
    let checkpoint = Checkpoint::read(from)?;
    let mut locked = session.lock()?;
    let grid = locked.film().grid();
    let mut fresh =
        Session::new(grid.width(), grid.height(), locked.criterion().clone(), locked.params().clone())?;
    fresh.set_pixels(locked.pixels());
    *locked = fresh.resume(job, checkpoint)?;
    Ok(())
}
