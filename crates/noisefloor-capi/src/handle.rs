//! Handles: numbers in the shape of pointers. Nothing follows them, and none is given twice, so one that was freed,
//! one of another kind, and one that never was are errors, whatever threads do.

use crate::border;
use crate::status::{Failure, NfStatus};
use std::any::Any;
use std::collections::BTreeMap;
use std::ptr::without_provenance_mut;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, PoisonError, RwLock};

static ALIVE: RwLock<BTreeMap<usize, Arc<dyn Any + Send + Sync>>> = RwLock::new(BTreeMap::new());
/// Numbers are multiples of 64, as pointers to objects are. They begin where no page is.
static NEXT: AtomicUsize = AtomicUsize::new(64);

/// Objects that C has handles of.
pub(crate) trait Handle: Any + Send + Sync {
    /// What errors call them.
    const NAME: &str;
}

/// Makes an object and gives the caller its handle. A pointer that cannot be written is noticed before `make` runs.
///
/// # Safety
/// As [`border::write`].
pub(crate) unsafe fn give<T: Handle>(
    place: *mut *mut T,
    make: impl FnOnce() -> Result<T, Failure>,
) -> Result<(), Failure> {
    border::check(place, T::NAME)?;
    let object = Arc::new(make()?);
    let number = NEXT.fetch_add(64, Ordering::Relaxed);
    // SAFETY: as for this function.
    unsafe { border::write(place, without_provenance_mut(number), T::NAME) }?;
    ALIVE.write().unwrap_or_else(PoisonError::into_inner).insert(number, object);
    Ok(())
}

/// What a handle stands for. It lives as long as somebody uses it, also when it is freed meanwhile.
pub(crate) fn get<T: Handle>(handle: *const T) -> Result<Arc<T>, Failure> {
    if handle.is_null() {
        return Err(Failure::new(NfStatus::NullPointer, format!("{} is NULL", T::NAME)));
    }
    let object = ALIVE.read().unwrap_or_else(PoisonError::into_inner).get(&handle.addr()).cloned();
    let wrong = |why: &str| Failure::new(NfStatus::Handle, format!("{} is {why}", T::NAME));
    let object = object.ok_or_else(|| wrong("no handle of this library, or was freed"))?;
    object.downcast().map_err(|_| wrong("a handle of something else"))
}

/// Takes a handle back. Null is nothing to take.
pub(crate) fn free<T: Handle>(handle: *mut T) -> Result<(), Failure> {
    if !handle.is_null() {
        get(handle)?;
        ALIVE.write().unwrap_or_else(PoisonError::into_inner).remove(&handle.addr());
    }
    Ok(())
}
