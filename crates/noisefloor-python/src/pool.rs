//! Threads for parallel work that survive `os.fork()`.
//!
//! Only the thread that forks exists in the child. rayon's own pool would be there without its threads, and
//! work would wait for them for good: `multiprocessing` forks on Linux up to Python 3.13. So work runs in a
//! pool that belongs to a process, and another process makes its own.

use rayon::{ThreadPool, ThreadPoolBuilder};
use std::cell::RefCell;
use std::process;
use std::sync::{Arc, Mutex, TryLockError};

/// A pool, and the process whose threads it has.
#[derive(Clone)]
struct Own {
    process: u32,
    pool: Arc<ThreadPool>,
}

/// The pool that all threads of a process share.
static SHARED: Mutex<Option<Own>> = Mutex::new(None);

thread_local! {
    /// The pool that this thread has used last.
    static LAST: RefCell<Option<Own>> = const { RefCell::new(None) };
}

/// Runs parallel work in the pool of this process. Locks that `work` would wait for have to be taken before:
/// a thread of the pool that waits for one may be the one that is waited for.
pub(crate) fn run<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    match pool() {
        Some(pool) => pool.install(work),
        // There are no threads to be had: rayon says so in its own way
        None => work(),
    }
}

fn pool() -> Option<Arc<ThreadPool>> {
    let process = process::id();
    let last = LAST.with_borrow(Clone::clone).filter(|own| own.process == process);
    let own = match last {
        Some(own) => own,
        None => shared(process)?,
    };
    let pool = Arc::clone(&own.pool);
    LAST.with_borrow_mut(|last| forget(last.replace(own), process));
    Some(pool)
}

/// The shared pool, made if this process has none.
fn shared(process: u32) -> Option<Own> {
    let make = || Some(Own { process, pool: Arc::new(ThreadPoolBuilder::new().build().ok()?) });
    let mut shared = match SHARED.try_lock() {
        Ok(shared) => shared,
        Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
        // Another thread makes the pool; or it did so when this process was forked off, and is not here to
        // end it. Nothing tells the two apart, and a pool of one's own does no harm
        Err(TryLockError::WouldBlock) => return make(),
    };
    match &*shared {
        Some(own) if own.process == process => Some(own.clone()),
        _ => {
            let own = make()?;
            forget(shared.replace(own.clone()), process);
            Some(own)
        }
    }
}

/// A pool of another process cannot be ended in this one: its locks may be held by threads that are not here.
fn forget(own: Option<Own>, process: u32) {
    if let Some(own) = own.filter(|own| own.process != process) {
        std::mem::forget(own);
    }
}
