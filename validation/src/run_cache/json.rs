//! Records as JSON files.

use std::fs;
use std::path::Path;

use files::write_atomically;
use miette::{IntoDiagnostic, WrapErr};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A record; `None` if it is missing or damaged, so that it is made again.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Option<T> {
    serde_json::from_slice(&fs::read(path).ok()?).ok()
}

/// Writes a record, whole or not at all.
///
/// # Errors
/// If the file cannot be written.
pub fn write_json(path: &Path, value: &impl Serialize) -> miette::Result<()> {
    let text = serde_json::to_vec_pretty(value).into_diagnostic()?;
    write_atomically(path, |temporary| fs::write(temporary, text))
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot write {}", path.display()))
}
