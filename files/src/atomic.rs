//! Files that are written whole or not at all.

use std::ffi::OsString;
use std::fmt::Display;
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use tempfile::TempPath;

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

/// Writes `path` through a temporary file beside it, so that readers of `path` find either the old
/// file or the complete new one.
///
/// `fill` receives the path of the temporary file, which exists and is empty, and must leave a closed
/// file there. The file is flushed to the disk and renamed to `path`. If `fill` fails, its file is
/// removed. A link at `path` stays: the file that it leads to is replaced.
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
    fs::write(file.temporary(), [0]).map_err(failed)
}

/// A file being written under a temporary name: gets its own name when [published](Self::publish), and
/// is removed when dropped before.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    target: PathBuf,
    temporary: TempPath,
}

impl AtomicFile {
    /// The future contents of `path`. Creates missing directories and an empty temporary file.
    ///
    /// # Errors
    /// If the system refuses either.
    pub fn new(path: &Path) -> Result<Self, WriteError> {
        let target = link_target(path).map_err(WriteError::at(path, "follow its links"))?;
        fs::create_dir_all(directory_of(&target))
            .map_err(WriteError::at(path, "create its directory"))?;
        // In the same directory, since a rename is atomic only within one file system. A name that no
        // file has, so that nobody's file or link of that name is touched.
        let mut builder = tempfile::Builder::new();
        let prefix = temporary_prefix(&target);
        builder.prefix(&prefix).suffix(TEMPORARY);
        // As any other file, and not for this user alone.
        builder.permissions(PermissionsExt::from_mode(0o666));
        let temporary = builder
            .tempfile_in(directory_of(&target))
            .map_err(WriteError::at(path, "create a file beside it"))?
            .into_temp_path();
        Ok(Self { path: path.to_owned(), target, temporary })
    }

    /// The path to write to.
    pub fn temporary(&self) -> &Path {
        &self.temporary
    }

    /// Flushes the file, which must be closed, to the disk and gives it its name.
    ///
    /// # Errors
    /// If the system refuses either.
    pub fn publish(self) -> Result<(), WriteError> {
        let Self { path, target, temporary } = self;
        let failed = |action| WriteError::at(&path, action);
        // Without the first flush, a power cut could leave the new name with old or no contents;
        // without the second, the new name itself could be lost.
        File::open(&temporary)
            .and_then(|file| file.sync_all())
            .map_err(failed("flush it to the disk"))?;
        temporary
            .persist(&target)
            .map_err(|error| failed("rename its temporary file")(error.error))?;
        File::open(directory_of(&target))
            .and_then(|directory| directory.sync_all())
            .map_err(failed("flush its directory to the disk"))
    }
}

/// How the names of temporary files end.
const TEMPORARY: &str = ".dempm-tmp";

/// How the temporary files of `target` begin: `.NAME.`, then six letters or digits.
fn temporary_prefix(target: &Path) -> OsString {
    let mut prefix = OsString::from(".");
    prefix.push(target.file_name().unwrap_or_default());
    prefix.push(".");
    prefix
}

/// Removes the temporary files that killed processes have left of `target`. The caller holds the lock of
/// `target`, so that nobody is writing one.
pub(crate) fn remove_leftovers(target: &Path) {
    let prefix = temporary_prefix(target).into_string().unwrap_or_default();
    let Ok(entries) = fs::read_dir(directory_of(target)) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name().into_string().unwrap_or_default();
        let random = name.strip_prefix(&prefix).and_then(|rest| rest.strip_suffix(TEMPORARY));
        if random.is_some_and(|r| r.len() == 6 && r.bytes().all(|b| b.is_ascii_alphanumeric())) {
            // One that stays only takes up space.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Where a file written to `path` is to be: `path`, or what a link there leads to, which need not exist.
pub(crate) fn link_target(path: &Path) -> io::Result<PathBuf> {
    /// As many as Linux follows.
    const MOST_LINKS: usize = 40;
    let mut target = path.to_owned();
    for _ in 0..MOST_LINKS {
        match fs::symlink_metadata(&target) {
            Ok(data) if data.is_symlink() => {
                let next = fs::read_link(&target)?;
                target = directory_of(&target).join(next);
            }
            _ => return Ok(target),
        }
    }
    Err(io::Error::from_raw_os_error(libc::ELOOP))
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
    use std::os::unix::fs::symlink;

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
    fn links_are_followed_and_files_of_temporary_names_are_left_alone() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        fs::create_dir(at("far")).unwrap();
        fs::write(at("far/target.txt"), "old").unwrap();
        symlink("far/target.txt", at("link.txt")).unwrap();
        symlink("link.txt", at("link of link.txt")).unwrap();
        fs::write(at("link.txt.tmp"), "mine").unwrap();
        write_text(&at("link of link.txt"), "new").unwrap();
        assert_eq!(fs::read_to_string(at("far/target.txt")).unwrap(), "new");
        assert!(at("link of link.txt").is_symlink() && at("link.txt").is_symlink());
        assert_eq!(fs::read_to_string(at("link.txt.tmp")).unwrap(), "mine");
        symlink("far/not there yet.txt", at("dangling.txt")).unwrap();
        write_text(&at("dangling.txt"), "first").unwrap();
        assert_eq!(fs::read_to_string(at("far/not there yet.txt")).unwrap(), "first");
        symlink("round.txt", at("round.txt")).unwrap();
        assert!(write_text(&at("round.txt"), "").is_err());
        assert_eq!(fs::read_dir(at("far")).unwrap().count(), 2);
    }

    #[test]
    fn only_leftovers_of_the_same_file_are_removed() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        let leftover = AtomicFile::new(&at("run.h5")).unwrap();
        let name = leftover.temporary().to_owned();
        std::mem::forget(leftover);
        let others = [".run.h5.ckpt.abcdef.dempm-tmp", "run.h5.tmp", ".run.h5.backup", "run.h5"];
        for name in others {
            fs::write(at(name), "").unwrap();
        }
        remove_leftovers(&at("run.h5"));
        assert!(!name.exists());
        assert!(others.iter().all(|name| at(name).exists()));
    }

    #[test]
    fn a_written_file_has_the_permissions_of_any_other() {
        let directory = tempfile::tempdir().unwrap();
        let [plain, atomic] = ["plain", "atomic"].map(|name| directory.path().join(name));
        fs::write(&plain, "").unwrap();
        write_text(&atomic, "").unwrap();
        let mode = |path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&plain), mode(&atomic));
    }

    #[test]
    fn the_error_names_the_file() {
        let failure: Result<(), WriteError> =
            write_atomically(Path::new("/proc/nowhere/file"), |_| Ok(()));
        assert!(failure.unwrap_err().to_string().contains("/proc/nowhere/file"));
    }
}
