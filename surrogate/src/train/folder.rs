//! The folder of a training: what is in it, and that only one training writes there.

use std::path::{Path, PathBuf};

use files::FileLock;
use miette::{IntoDiagnostic, WrapErr};

/// What a training writes. The checkpoint is first: if the others cannot all be removed, at least nothing
/// goes on from what is left.
const FILES: [&str; 6] = [
    "checkpoint.bin",
    "best.safetensors",
    "last.safetensors",
    "log.csv",
    "validation.csv",
    "loss.svg",
];

/// The checkpoint of a training in `folder`.
pub fn checkpoint_in(folder: &Path) -> PathBuf {
    folder.join(FILES[0])
}

/// The files of a training in `folder` that are there.
pub fn files_in(folder: &Path) -> impl Iterator<Item = PathBuf> {
    FILES.map(|name| folder.join(name)).into_iter().filter(|path| path.exists())
}

/// Keeps other trainings out of `folder`, which is made, until the lock is dropped.
///
/// # Errors
/// If another training is there, or no file can be written.
pub fn claim(folder: &Path) -> miette::Result<FileLock> {
    FileLock::take(&checkpoint_in(folder))
        .wrap_err_with(|| format!("{}: cannot train into this folder", folder.display()))
}

/// Removes the files of an old training from `folder`.
///
/// # Errors
/// If one cannot be removed.
pub fn clear(folder: &Path) -> miette::Result<()> {
    for path in files_in(folder) {
        std::fs::remove_file(&path)
            .into_diagnostic()
            .wrap_err_with(|| format!("{}: cannot remove it", path.display()))?;
    }
    Ok(())
}
