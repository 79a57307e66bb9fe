//! Error codes with messages, and the guard between panics and C.

use noisefloor::{
    SessionError, checkpoint::CheckpointError, criterion::CriterionError, film::FilmError, model::ModelError,
    oracle::PeopleError, params::ParamsError, tile::TileError, viewing::ViewingTextError,
};
use std::any::Any;
use std::cell::{Cell, RefCell};
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// How a call ended. nf_last_error has the words.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NfStatus {
    /// Done.
    Ok = 0,
    /// A pointer is NULL that must not be, or not aligned for what it leads to.
    NullPointer = 1,
    /// A parameter is out of its range.
    Argument = 2,
    /// An array, a picture or a tile has another size than it must have.
    Size = 3,
    /// A tile that does not exist, or a batch without new samples.
    Batch = 4,
    /// A model file is damaged, foreign, or made for another version.
    Model = 5,
    /// The model cannot judge this: it needs a reference, other tiles, or other viewing conditions.
    Criterion = 6,
    /// A checkpoint is damaged, foreign, or of another job.
    Checkpoint = 7,
    /// A file cannot be read or written.
    Io = 8,
    /// Not known yet, or never: the call says which.
    Unavailable = 9,
    /// A mistake inside the library. Please report it.
    Internal = 10,
    /// There is not enough memory for the picture, or for work on all of it. The session is as it was.
    Memory = 11,
    /// Samples cannot be what they are said to be, such as a batch that contains the one before. No tile is done
    /// by them.
    Fault = 12,
    /// A handle that was freed, is of another kind, or does not come from this library.
    Handle = 13,
}

pub(crate) struct Failure {
    pub(crate) status: NfStatus,
    pub(crate) message: String,
}

impl Failure {
    pub(crate) fn new(status: NfStatus, message: impl Into<String>) -> Self {
        Self { status, message: message.into() }
    }
}

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
    static LAST_WARNINGS: RefCell<CString> = RefCell::default();
    /// Whether this thread is inside a denoiser, whose session waits for it.
    pub(crate) static DENOISING: Cell<bool> = const { Cell::new(false) };
}

/// Refuses what would wait for itself.
pub(crate) fn not_while_denoising() -> Result<(), Failure> {
    match DENOISING.get() {
        true => {
            Err(Failure::new(NfStatus::Argument, "a denoiser cannot use sessions: one of them waits for it"))
        }
        false => Ok(()),
    }
}

/// Runs what a function of the library does. Whatever goes wrong becomes a status and a message.
///
/// Nothing half done is seen after a panic: sessions stand behind a lock that a panic poisons, oracles never
/// change, and results are written last.
pub(crate) fn guard(body: impl FnOnce() -> Result<(), Failure>) -> NfStatus {
    #[cfg(target_family = "wasm")]
    keep_last_words();
    let outcome = catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|panic| {
        Err(Failure::new(NfStatus::Internal, format!("noisefloor made a mistake: {}", words(&*panic))))
    });
    let Err(failure) = outcome else { return NfStatus::Ok };
    set_last_error(&failure.message);
    failure.status
}

/// Lets `nf_last_error` say after a trap what the panic said: on a page, a panic does not unwind.
#[cfg(target_family = "wasm")]
fn keep_last_words() {
    static HOOK: std::sync::Once = std::sync::Once::new();
    HOOK.call_once(|| {
        std::panic::set_hook(Box::new(|panic| {
            set_last_error(&format!("noisefloor made a mistake: {panic}"))
        }));
    });
}

fn set_last_error(message: &str) {
    let message = CString::new(message.replace('\0', "?")).unwrap_or_default();
    LAST_ERROR.with(|last| *last.borrow_mut() = message);
}

/// Replaces what [`nf_last_warnings`] says.
pub(crate) fn set_last_warnings(warnings: &[String]) {
    let lines = CString::new(warnings.join("\n").replace('\0', "?")).unwrap_or_default();
    LAST_WARNINGS.with(|last| *last.borrow_mut() = lines);
}

fn words(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no words")
}

/// What went wrong in the last call on this thread that failed, in English, for people; an empty string if
/// none has. Valid until the next call on this thread fails, or the thread ends.
#[unsafe(no_mangle)]
pub extern "C" fn nf_last_error() -> *const c_char {
    LAST_ERROR.try_with(|last| last.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

/// What is likely wrong with the pictures of the last nf_excess or nf_excess_denoised on this thread, such as another
/// exposure of one, in English, one a line; an empty string if nothing is. Valid until the next such call on this
/// thread, or the thread ends.
#[unsafe(no_mangle)]
pub extern "C" fn nf_last_warnings() -> *const c_char {
    LAST_WARNINGS.try_with(|last| last.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

/// The version of the library, as text: "0.1.0". Lives as long as the program.
#[unsafe(no_mangle)]
pub extern "C" fn nf_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}

impl From<ParamsError> for Failure {
    fn from(error: ParamsError) -> Self {
        Self::new(NfStatus::Argument, error.to_string())
    }
}

impl From<PeopleError> for Failure {
    fn from(error: PeopleError) -> Self {
        Self::new(NfStatus::Argument, error.to_string())
    }
}

impl From<ViewingTextError> for Failure {
    fn from(error: ViewingTextError) -> Self {
        Self::new(NfStatus::Argument, error.to_string())
    }
}

impl From<TileError> for Failure {
    fn from(error: TileError) -> Self {
        Self::new(NfStatus::Size, error.to_string())
    }
}

impl From<FilmError> for Failure {
    fn from(error: FilmError) -> Self {
        let status =
            if matches!(error, FilmError::Memory { .. }) { NfStatus::Memory } else { NfStatus::Batch };
        Self::new(status, error.to_string())
    }
}

impl From<CriterionError> for Failure {
    fn from(error: CriterionError) -> Self {
        Self::new(NfStatus::Criterion, error.to_string())
    }
}

impl From<ModelError> for Failure {
    fn from(error: ModelError) -> Self {
        Self::new(NfStatus::Model, error.to_string())
    }
}

impl From<CheckpointError> for Failure {
    fn from(error: CheckpointError) -> Self {
        let status =
            if matches!(error, CheckpointError::Io(_)) { NfStatus::Io } else { NfStatus::Checkpoint };
        Self::new(status, error.to_string())
    }
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Self {
        match error {
            SessionError::Params(error) => error.into(),
            SessionError::Tile(error) => error.into(),
            SessionError::Film(error) => error.into(),
            SessionError::Criterion(error) => error.into(),
            SessionError::Fault(fault) => Self::new(NfStatus::Fault, fault.to_string()),
            SessionError::Background(_) => Self::new(NfStatus::Internal, error.to_string()),
            other => Self::new(NfStatus::Argument, other.to_string()),
        }
    }
}
