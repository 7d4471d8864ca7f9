//! The folder of a training: its files, and that only one training writes there.

use std::path::{Path, PathBuf};

use files::{FileLock, ReplacesInput, is_same, refuse_input};

use super::config::TrainConfig;
use super::error::TrainError;
use crate::network::Initialisation;

/// Files of a training. The checkpoint comes first: if removal stops half way, nothing can continue
/// from the rest.
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

/// The existing files of a training in `folder`.
pub fn files_in(folder: &Path) -> impl Iterator<Item = PathBuf> {
    FILES.map(|name| folder.join(name)).into_iter().filter(|path| path.exists())
}

/// Checks that a new training may use `folder`; `config_file` is named in errors.
///
/// # Errors
/// If there is a training already that must not be overwritten, or that the new one starts from.
pub fn check_new(
    folder: &Path,
    overwrite: bool,
    config: &TrainConfig,
    config_file: &Path,
) -> Result<(), TrainError> {
    let Some(file) = files_in(folder).next() else { return Ok(()) };
    if !overwrite {
        let resumable = file == checkpoint_in(folder);
        return Err(TrainError::Exists { folder: folder.to_owned(), resumable });
    }
    match &config.start {
        Initialisation::Weights(start) if files_in(folder).any(|file| is_same(&file, start)) => {
            let (config, weights) = (config_file.to_owned(), start.clone());
            Err(TrainError::RemovesStart { config, weights })
        }
        _ => Ok(()),
    }
}

/// Refuses a folder in which a file of the training would replace one of its inputs.
///
/// # Errors
/// If there is such a file.
pub fn refuse_inputs(folder: &Path, inputs: &[&PathBuf]) -> Result<(), ReplacesInput> {
    FILES.iter().try_for_each(|name| refuse_input(&folder.join(name), inputs))
}

/// Creates `folder` and keeps other trainings out of it until the lock is dropped. Removes what a killed
/// training has left.
///
/// # Errors
/// If another training holds it, or no file can be written.
pub fn lock(folder: &Path) -> Result<FileLock, TrainError> {
    let lock = FileLock::take(&checkpoint_in(folder))
        .map_err(|source| TrainError::Folder { folder: folder.to_owned(), source })?;
    FILES.iter().for_each(|name| lock.remove_leftovers_of(&folder.join(name)));
    Ok(lock)
}

/// Removes the files of an old training from `folder`.
///
/// # Errors
/// If one cannot be removed.
pub fn clear(folder: &Path) -> Result<(), TrainError> {
    for path in files_in(folder) {
        std::fs::remove_file(&path).map_err(|source| TrainError::Remove { path, source })?;
    }
    Ok(())
}
