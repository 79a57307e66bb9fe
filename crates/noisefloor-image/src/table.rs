//! Tables beside pictures.

use crate::atomic::write_atomic;
use crate::error::WriteError;
use serde::Serialize;
use std::path::Path;

/// Writes rows as CSV, under the names of their fields; the file appears complete or not at all.
///
/// # Errors
/// Those of [`write_atomic`].
pub fn write_csv<T: Serialize>(
    path: impl AsRef<Path>,
    rows: impl IntoIterator<Item = T>,
) -> Result<(), WriteError> {
    write_atomic(path, |to| {
        let mut csv = csv::Writer::from_writer(to);
        for row in rows {
            csv.serialize(row)?;
        }
        csv.flush().map_err(csv::Error::from)
    })
}
