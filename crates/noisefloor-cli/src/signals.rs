//! Ctrl-C and SIGTERM.

use crate::say::note;
use anyhow::Context;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Ended by Ctrl-C or SIGTERM, with everything written: 128 + SIGINT.
pub const INTERRUPTED: u8 = 130;

pub const AFTER_THIS_BATCH: &str = "stopping after this batch, and writing what there is";

/// Sets the flag on the first signal, and says how the work ends; a second signal ends the process at once.
pub fn cancel_on_signal(cancel: Arc<AtomicBool>, says: &'static str) -> anyhow::Result<()> {
    cancel_all_on_signal(vec![cancel], says)
}

/// The same for several flags, of which the first says whether there was a signal before.
pub fn cancel_all_on_signal(flags: Vec<Arc<AtomicBool>>, says: &'static str) -> anyhow::Result<()> {
    on_signal(move || {
        let again: Vec<bool> = flags.iter().map(|flag| flag.swap(true, Ordering::Relaxed)).collect();
        if again.first() == Some(&true) {
            end();
        }
        note!("\n{says} (Ctrl-C again to quit at once)");
    })
}

/// Ends the process on the first signal: for work of which every result is on disk as soon as it is there.
pub fn end_on_signal(says: &'static str) -> anyhow::Result<()> {
    on_signal(move || {
        note!("\n{says}");
        end();
    })
}

/// Ends this process as SIGTERM does: with everything written, if that was prepared for.
pub fn terminate_self() {
    #[cfg(unix)]
    let sent =
        rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::TERM).is_ok();
    #[cfg(not(unix))]
    let sent = false;
    if !sent {
        end();
    }
}

fn on_signal(handler: impl FnMut() + Send + 'static) -> anyhow::Result<()> {
    ctrlc::set_handler(handler).context("the handler for Ctrl-C could not be set")
}

fn end() -> ! {
    noisefloor_sidecar::end_all();
    std::process::exit(i32::from(INTERRUPTED));
}
