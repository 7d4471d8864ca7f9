//! Files that are written whole or not at all.

use std::ffi::OsString;
use std::fmt::Display;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// A file that could not be written; an older file of that name is untouched.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot {action}", path.display())]
pub struct WriteError {
    /// The file to be written.
    pub path: PathBuf,
    /// The step that failed, such as "write it".
    pub action: &'static str,
    /// The system's reason.
    pub source: io::Error,
}

impl WriteError {
    /// Adds the file and the failed step to an error of the system:
    /// `.map_err(WriteError::at(path, "write it"))`.
    pub fn at(path: &Path, action: &'static str) -> impl Fn(io::Error) -> Self {
        move |source| Self { path: path.to_owned(), action, source }
    }
}

impl miette::Diagnostic for WriteError {
    fn help(&self) -> Option<Box<dyn Display + '_>> {
        let full = [io::ErrorKind::StorageFull, io::ErrorKind::QuotaExceeded];
        full.contains(&self.source.kind()).then_some(Box::new(
            "free some disk space and repeat the command; --resume continues an interrupted run",
        ))
    }
}

impl From<WriteError> for io::Error {
    fn from(error: WriteError) -> Self {
        io::Error::new(error.source.kind(), error)
    }
}

/// Writes `path` through the temporary file `NAME.tmp` beside it, so that readers of `path` find
/// either the old file or the complete new one.
///
/// `fill` receives the path of the temporary file, whose directory exists, and must leave a closed
/// file there. The file is flushed to the disk and renamed to `path`. If `fill` fails, its file is
/// removed. A `NAME.tmp` left behind by a killed process is overwritten by the next one.
///
/// # Errors
/// Those of `fill`, and if the file cannot be put in its place.
pub fn write_atomically<T, E: From<WriteError>>(
    path: &Path,
    fill: impl FnOnce(&Path) -> Result<T, E>,
) -> Result<T, E> {
    let file = AtomicFile::new(path)?;
    let value = fill(file.temporary())?;
    file.publish()?;
    Ok(value)
}

/// Writes a text file atomically.
///
/// # Errors
/// If it cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<(), WriteError> {
    write_atomically(path, |temporary| {
        fs::write(temporary, text).map_err(WriteError::at(path, "write it"))
    })
}

/// Checks before a long computation that [`write_atomically`] could write its result to `path`.
///
/// # Errors
/// If the directory cannot be created or written to, or `path` is a directory.
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    let file = AtomicFile::new(path)?;
    let failed = WriteError::at(path, "write it");
    if path.is_dir() {
        return Err(failed(io::ErrorKind::IsADirectory.into()));
    }
    // Dropped unpublished, which removes it again.
    File::create(file.temporary()).map(drop).map_err(failed)
}

/// A file being written as `NAME.tmp`: becomes `NAME` when [published](Self::publish), and is
/// removed when dropped before.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    temporary: PathBuf,
    published: bool,
}

impl AtomicFile {
    /// The future contents of `path`. Creates missing directories, but no file.
    ///
    /// # Errors
    /// If the directory cannot be created.
    pub fn new(path: &Path) -> Result<Self, WriteError> {
        fs::create_dir_all(directory_of(path))
            .map_err(WriteError::at(path, "create its directory"))?;
        // In the same directory, since a rename is atomic only within one file system.
        let temporary = path_beside(path, ".tmp");
        Ok(Self { path: path.to_owned(), temporary, published: false })
    }

    /// The path to write to.
    pub fn temporary(&self) -> &Path {
        &self.temporary
    }

    /// Flushes the file, which must be closed, to the disk and gives it its name.
    ///
    /// # Errors
    /// If the system refuses either.
    pub fn publish(mut self) -> Result<(), WriteError> {
        let failed = |action| WriteError::at(&self.path, action);
        // Without the first flush, a power cut could leave the new name with old or no contents;
        // without the second, the new name itself could be lost.
        File::open(&self.temporary)
            .and_then(|file| file.sync_all())
            .map_err(failed("flush it to the disk"))?;
        fs::rename(&self.temporary, &self.path).map_err(failed("rename its temporary file"))?;
        self.published = true;
        #[cfg(unix)]
        File::open(directory_of(&self.path))
            .and_then(|directory| directory.sync_all())
            .map_err(failed("flush its directory to the disk"))?;
        Ok(())
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if !self.published {
            // Failures do not matter: there may be no file yet. Emptied first, because a file that
            // is still open somewhere keeps its space on the disk.
            let _ = File::options().write(true).truncate(true).open(&self.temporary);
            let _ = fs::remove_file(&self.temporary);
        }
    }
}

pub(crate) fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// `path` with `ending` appended to its name: `run.h5` and `.lock` give `run.h5.lock`.
pub fn path_beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.file_name().map_or_else(OsString::new, OsString::from);
    name.push(ending);
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failure_leaves_the_old_file_and_no_temporary_one() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("new/kept.txt");
        write_atomically::<_, io::Error>(&path, |tmp| fs::write(tmp, "old")).unwrap();
        let failure: Result<(), io::Error> = write_atomically(&path, |tmp| {
            fs::write(tmp, "half of the ne")?;
            Err(io::Error::other("disk full"))
        });
        assert_eq!(failure.unwrap_err().to_string(), "disk full");
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[test]
    fn a_place_is_tried_without_a_trace() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("kept.txt");
        fs::write(&path, "old").unwrap();
        check_writable(&path).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
        assert!(check_writable(&path.join("below")).is_err());
        let error = check_writable(directory.path()).unwrap_err();
        assert_eq!(error.source.kind(), io::ErrorKind::IsADirectory);
    }

    #[test]
    fn the_error_names_the_file() {
        let failure: Result<(), WriteError> =
            write_atomically(Path::new("/proc/nowhere/file"), |_| Ok(()));
        assert!(failure.unwrap_err().to_string().contains("/proc/nowhere/file"));
    }
}
