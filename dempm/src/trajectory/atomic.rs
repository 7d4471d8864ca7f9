//! Files that are written whole or not at all.

use std::ffi::OsString;
use std::fmt::Display;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// A file that could not be written; the file that stood there before, if any, is untouched.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot {action}", path.display())]
pub struct WriteError {
    /// The file that was to be written.
    pub path: PathBuf,
    /// What failed.
    pub action: &'static str,
    /// Why.
    pub source: io::Error,
}

impl miette::Diagnostic for WriteError {
    fn help(&self) -> Option<Box<dyn Display + '_>> {
        let full = [io::ErrorKind::StorageFull, io::ErrorKind::QuotaExceeded];
        full.contains(&self.source.kind()).then_some(Box::new(
            "make room on that disk and give the same command again, `dempm run` with --resume",
        ))
    }
}

impl From<WriteError> for io::Error {
    fn from(error: WriteError) -> Self {
        io::Error::new(error.source.kind(), error)
    }
}

/// Writes `path` through a temporary neighbour, so that whoever opens `path` finds either the old
/// file or the complete new one.
///
/// `fill` receives the path `NAME.tmp` in the same directory (missing directories are made) and
/// must leave a closed file there. That file is flushed to the disk and renamed to `path`. If
/// `fill` fails, its file is removed and its error returned. A `NAME.tmp` left by a killed process
/// is overwritten by the next one.
pub fn write_atomically<T, E: From<WriteError>>(
    path: &Path,
    fill: impl FnOnce(&Path) -> Result<T, E>,
) -> Result<T, E> {
    let draft = Draft::new(path)?;
    let value = fill(draft.temporary())?;
    draft.publish()?;
    Ok(value)
}

/// Writes a file whose contents are all there.
///
/// # Errors
/// If it cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<(), WriteError> {
    write_atomically(path, |temporary| fs::write(temporary, text).map_err(failed(path, "write it")))
}

/// Says before the work is done whether [`write_atomically`] would find a place for its result.
///
/// # Errors
/// If the directory cannot be made or takes no files, or `path` is a directory.
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    let draft = Draft::new(path)?;
    if path.is_dir() {
        return Err(failed(path, "write it")(io::ErrorKind::IsADirectory.into()));
    }
    // Dropped, the draft removes its file.
    File::create(draft.temporary()).map(drop).map_err(failed(path, "write it"))
}

/// A file in the making, `NAME.tmp` beside `NAME`: removed again unless it is published.
#[derive(Debug)]
pub(super) struct Draft {
    path: PathBuf,
    temporary: PathBuf,
    published: bool,
}

impl Draft {
    /// A place for the future contents of `path`; makes missing directories, but no file.
    pub fn new(path: &Path) -> Result<Self, WriteError> {
        fs::create_dir_all(directory_of(path)).map_err(failed(path, "make its directory"))?;
        // A rename is atomic only within one file system.
        let temporary = beside(path, ".tmp");
        Ok(Self { path: path.to_owned(), temporary, published: false })
    }

    /// Where to write.
    pub fn temporary(&self) -> &Path {
        &self.temporary
    }

    /// Flushes the file, which must be closed, to the disk and gives it its name.
    pub fn publish(mut self) -> Result<(), WriteError> {
        let failed = |action| failed(&self.path, action);
        // Without the first flush a power cut could leave the new name with old or no contents;
        // without the second one the new name itself could be lost.
        File::open(&self.temporary)
            .and_then(|file| file.sync_all())
            .map_err(failed("flush it to the disk"))?;
        fs::rename(&self.temporary, &self.path).map_err(failed("give it its name"))?;
        self.published = true;
        #[cfg(unix)]
        File::open(directory_of(&self.path))
            .and_then(|directory| directory.sync_all())
            .map_err(failed("flush its directory to the disk"))?;
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if !self.published {
            // There may be none yet. The error that matters is the one that led here. Emptied first,
            // because a file that is still open somewhere keeps its space on the disk.
            let _ = File::options().write(true).truncate(true).open(&self.temporary);
            let _ = fs::remove_file(&self.temporary);
        }
    }
}

pub(super) fn failed(path: &Path, action: &'static str) -> impl Fn(io::Error) -> WriteError {
    move |source| WriteError { path: path.to_owned(), action, source }
}

pub(super) fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// The file beside `path` whose name has this at its end.
pub(crate) fn beside(path: &Path, ending: &str) -> PathBuf {
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
