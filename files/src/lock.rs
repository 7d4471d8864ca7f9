//! One writer at a time.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use crate::atomic::{WriteError, directory_of, path_beside};

/// A lock that could not be taken.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum LockError {
    /// Another process holds the lock.
    #[error("{}: another run is writing it", path.display())]
    InUse {
        /// The locked file.
        path: PathBuf,
    },
    /// The lock file could not be created.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
}

/// Keeps other processes from writing a file: two that write the same one would publish each
/// other's temporary file.
///
/// An advisory lock on `NAME.lock` beside `NAME`. The system releases it when the process ends.
#[derive(Debug)]
pub struct FileLock {
    path: PathBuf,
    _file: File,
}

impl FileLock {
    /// Takes the lock of the file `path`; creates missing directories.
    ///
    /// # Errors
    /// If another process holds it or `NAME.lock` cannot be created. On file systems without locks
    /// it always succeeds.
    pub fn take(path: &Path) -> Result<Self, LockError> {
        fs::create_dir_all(directory_of(path))
            .map_err(WriteError::at(path, "create its directory"))?;
        let own = path_beside(path, ".lock");
        let file = File::create(&own).map_err(WriteError::at(path, "lock it"))?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(LockError::InUse { path: path.to_owned() });
        }
        Ok(Self { path: own, _file: file })
    }
}

impl Drop for FileLock {
    fn drop(&mut self) {
        // A lock file left behind is harmless.
        let _ = fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_locked_once_at_a_time() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("new/run.h5");
        let lock = FileLock::take(&path).unwrap();
        let error = FileLock::take(&path).unwrap_err().to_string();
        assert!(error.contains("run.h5: another run is writing it"), "{error}");
        drop(lock);
        FileLock::take(&path).unwrap();
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 0);
    }
}
