//! One run at a time on one trajectory file.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use super::atomic::{beside, directory_of, failed};
use super::{Result, TrajectoryError};

/// Keeps other runs off a trajectory file: two that write one would publish each other's drafts.
///
/// A lock on `NAME.lock` beside it, which ends with the process at the latest.
#[derive(Debug)]
pub struct TrajectoryLock {
    path: PathBuf,
    _file: File,
}

impl TrajectoryLock {
    /// Takes the lock of the trajectory file `path`; makes missing directories.
    ///
    /// # Errors
    /// Another run has it, or there is no place for it.
    pub fn take(path: &Path) -> Result<Self> {
        fs::create_dir_all(directory_of(path)).map_err(failed(path, "make its directory"))?;
        let own = beside(path, ".lock");
        let file = File::create(&own).map_err(failed(path, "lock it"))?;
        // Where files cannot be locked there is no such protection.
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(TrajectoryError::InUse { path: path.to_owned() });
        }
        Ok(Self { path: own, _file: file })
    }
}

impl Drop for TrajectoryLock {
    fn drop(&mut self) {
        // It does no harm if it stays.
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
        let lock = TrajectoryLock::take(&path).unwrap();
        let error = TrajectoryLock::take(&path).unwrap_err().to_string();
        assert!(error.contains("run.h5: another run is writing it"), "{error}");
        drop(lock);
        TrajectoryLock::take(&path).unwrap();
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 0);
    }
}
