//! Mitsuba XML.

use crate::{LoadError, Loaded};
use std::path::Path;

pub(crate) fn load(path: &Path) -> Result<Loaded, LoadError> {
    Err(LoadError::Format { path: path.to_owned() })
}
