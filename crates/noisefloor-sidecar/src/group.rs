//! Processes that end with all their descendants.

use crate::leftovers;
use std::io;
use std::process::{Child, Command, ExitStatus};

/// A running program and all that it starts: on Unix a process group of its own. Dropping it kills them all.
#[derive(Debug)]
pub(crate) struct Group {
    child: Child,
    status: Option<ExitStatus>,
}

impl Group {
    /// Starts a program at the head of a group. On Linux it ends with the thread that called this, too.
    pub(crate) fn spawn(command: &mut Command) -> io::Result<Self> {
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(command, 0);
        #[cfg(target_os = "linux")]
        end_with_this_thread(command);
        let child = command.spawn()?;
        leftovers::add_group(child.id());
        Ok(Self { child, status: None })
    }

    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// The program itself, for its pipes.
    pub(crate) fn child(&mut self) -> &mut Child {
        &mut self.child
    }

    /// How the program ended, if it has. What it left running is killed.
    pub(crate) fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        if self.status.is_none() && has_ended(&mut self.child)? {
            self.end();
        }
        Ok(self.status)
    }

    /// Kills the program and all its descendants, and reaps the program.
    pub(crate) fn end(&mut self) {
        if self.status.is_some() {
            return;
        }
        // The group before its head is reaped: until then nobody else can get its number.
        leftovers::kill_group(self.child.id());
        leftovers::remove_group(self.child.id());
        // A program that has ended cannot be killed; one that the system does not let us kill is not waited
        // for.
        if self.child.kill().is_ok() {
            self.status = self.child.wait().ok();
        }
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        self.end();
    }
}

/// Whether the program has ended; it is not reaped yet.
#[cfg(unix)]
fn has_ended(child: &mut Child) -> io::Result<bool> {
    use rustix::process::{Pid, WaitId, WaitIdOptions, waitid};
    let pid = Pid::from_child(child);
    let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
    Ok(waitid(WaitId::Pid(pid), options)?.is_some())
}

#[cfg(not(unix))]
fn has_ended(child: &mut Child) -> io::Result<bool> {
    Ok(child.try_wait()?.is_some())
}

/// Has the kernel kill the program when the thread that starts it ends, however that comes about.
#[cfg(target_os = "linux")]
#[allow(unsafe_code, reason = "the one way to do something between fork and exec")]
fn end_with_this_thread(command: &mut Command) {
    use rustix::process::{Signal, set_parent_process_death_signal};
    use std::os::unix::process::CommandExt;
    let ask = || Ok(set_parent_process_death_signal(Some(Signal::KILL))?);
    // SAFETY: between fork and exec only async-signal-safe functions may be called. This is one system call,
    // prctl(2): it neither allocates nor locks.
    unsafe { command.pre_exec(ask) };
}
