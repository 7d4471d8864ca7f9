//! One writer at a time.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use crate::atomic::{WriteError, directory_of, link_target, path_beside, remove_leftovers};

/// What a lock file begins with; the process that holds it follows.
const MARK: &str = "DEMPM lock, process ";

/// A lock that could not be taken.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum LockError {
    /// Another process holds the lock.
    #[error("{}: {holder} is writing it", path.display())]
    InUse {
        /// The locked file.
        path: PathBuf,
        /// The other process, in words.
        holder: String,
    },
    /// Something else has the name of the lock file.
    #[error("{}: in the way of the lock of that name, but not a lock file", path.display())]
    #[diagnostic(help("move it away, or choose another output with -o"))]
    Foreign {
        /// The file or link in the way.
        path: PathBuf,
    },
    /// The lock file could not be created.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
}

/// Keeps other processes from writing a file.
///
/// An advisory lock on `NAME.lock` beside `NAME`. The system releases it when the process ends.
#[derive(Debug)]
pub struct FileLock {
    path: PathBuf,
    _file: File,
}

impl FileLock {
    /// Takes the lock of the file `path`; creates missing directories, and removes temporary files that a
    /// killed process has left of it.
    ///
    /// # Errors
    /// If another process holds it or `NAME.lock` cannot be created. On file systems without locks
    /// it always succeeds.
    pub fn take(path: &Path) -> Result<Self, LockError> {
        Self::acquire(path, &mut |file| match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                Err(LockError::InUse { path: path.to_owned(), holder: holder(file) })
            }
            _ => Ok(()),
        })
    }

    /// As [`take`](Self::take), but waits for another process. `waiting` is called once if it has to,
    /// with that process in words.
    ///
    /// # Errors
    /// If `NAME.lock` cannot be created.
    pub fn wait(path: &Path, waiting: impl FnOnce(&str)) -> Result<Self, LockError> {
        let mut waiting = Some(waiting);
        Self::acquire(path, &mut |file| {
            if let Err(TryLockError::WouldBlock) = file.try_lock() {
                if let Some(waiting) = waiting.take() {
                    waiting(&holder(file));
                }
                file.lock().map_err(WriteError::at(path, "lock it"))?;
            }
            Ok(())
        })
    }

    /// Removes temporary files that a killed process has left of `side`, which only the holder of this
    /// lock writes.
    pub fn remove_leftovers_of(&self, side: &Path) {
        remove_leftovers(side);
    }

    fn acquire(
        path: &Path,
        lock: &mut dyn FnMut(&mut File) -> Result<(), LockError>,
    ) -> Result<Self, LockError> {
        let failed = WriteError::at(path, "lock it");
        let target = link_target(path).map_err(&failed)?;
        fs::create_dir_all(directory_of(&target))
            .map_err(WriteError::at(path, "create its directory"))?;
        let own = path_beside(&target, ".lock");
        loop {
            let mut file = open(&own).map_err(&failed)?.ok_or_else(|| foreign(&own))?;
            lock(&mut file)?;
            // Whoever held it may have removed the file meanwhile: its lock would protect nothing.
            if !is_at(&file, &own) {
                continue;
            }
            // Kept as it is if it cannot be written: only its name matters.
            let _ = write_mark(&mut file);
            remove_leftovers(&target);
            return Ok(Self { path: own, _file: file });
        }
    }
}

fn foreign(path: &Path) -> LockError {
    LockError::Foreign { path: path.to_owned() }
}

/// The lock file, created if there is none; `None` if something else is there.
fn open(path: &Path) -> io::Result<Option<File>> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false);
    let mut file = match options.custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK).open(path) {
        Ok(file) => file,
        Err(error) if error.raw_os_error() == Some(libc::ELOOP) => return Ok(None),
        Err(error) => return Err(error),
    };
    let own = file.metadata()?.is_file() && {
        let start = contents(&mut file);
        start.is_empty() || start.starts_with(MARK)
    };
    Ok(own.then_some(file))
}

/// The first bytes of a lock file.
fn contents(file: &mut File) -> String {
    let mut bytes = Vec::new();
    let read =
        file.seek(SeekFrom::Start(0)).and_then(|_| (&*file).take(64).read_to_end(&mut bytes));
    read.map_or_else(|_| String::new(), |_| String::from_utf8_lossy(&bytes).into_owned())
}

fn holder(file: &mut File) -> String {
    let text = contents(file);
    match text.strip_prefix(MARK) {
        Some(process) => format!("process {}", process.trim()),
        None => "another process".to_owned(),
    }
}

fn write_mark(file: &mut File) -> io::Result<()> {
    file.set_len(0)?;
    file.seek(SeekFrom::Start(0))?;
    writeln!(file, "{MARK}{}", std::process::id())
}

/// Whether `path` still leads to the open file.
fn is_at(file: &File, path: &Path) -> bool {
    let identity = |data: fs::Metadata| (data.dev(), data.ino());
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(open), Ok(named)) => identity(open) == identity(named),
        _ => false,
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
    use std::os::unix::fs::symlink;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn a_file_is_locked_once_at_a_time() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("new/run.h5");
        let lock = FileLock::take(&path).unwrap();
        let error = FileLock::take(&path).unwrap_err().to_string();
        let expected = format!("run.h5: process {} is writing it", std::process::id());
        assert!(error.contains(&expected), "{error}");
        drop(lock);
        FileLock::take(&path).unwrap();
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 0);
    }

    #[test]
    fn many_that_wait_take_turns_though_each_removes_the_lock_file() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("run.h5");
        let inside = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    for _ in 0..50 {
                        let lock = FileLock::wait(&path, |_| ()).unwrap();
                        assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0);
                        inside.fetch_sub(1, Ordering::SeqCst);
                        drop(lock);
                    }
                });
            }
        });
    }

    #[test]
    fn what_is_not_a_lock_file_is_left_alone() {
        let directory = tempfile::tempdir().unwrap();
        let [path, lock, other] =
            ["run.h5", "run.h5.lock", "thesis.tex"].map(|name| directory.path().join(name));
        fs::write(&other, "chapter 1").unwrap();
        symlink(&other, &lock).unwrap();
        let error = FileLock::take(&path).unwrap_err().to_string();
        assert!(error.contains("run.h5.lock: in the way"), "{error}");
        fs::remove_file(&lock).unwrap();
        fs::write(&lock, "a note of mine").unwrap();
        assert!(matches!(FileLock::take(&path), Err(LockError::Foreign { .. })));
        assert_eq!(fs::read_to_string(&lock).unwrap(), "a note of mine");
        assert_eq!(fs::read_to_string(&other).unwrap(), "chapter 1");
    }

    #[test]
    fn two_names_of_one_file_have_one_lock() {
        let directory = tempfile::tempdir().unwrap();
        let [file, link] = ["run.h5", "link.h5"].map(|name| directory.path().join(name));
        symlink(&file, &link).unwrap();
        let _lock = FileLock::take(&link).unwrap();
        assert!(matches!(FileLock::take(&file), Err(LockError::InUse { .. })));
    }
}
