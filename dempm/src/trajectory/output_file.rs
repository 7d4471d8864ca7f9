//! A file for libraries that write on after a failure.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

/// A file that fails once: it keeps the reason, which not every library hands on, and from then on
/// takes everything without writing it, since some write again as they are dropped and complain
/// about that.
#[derive(Debug)]
pub(crate) struct OutputFile {
    file: File,
    failure: Option<io::Error>,
}

impl OutputFile {
    /// Makes an empty file.
    pub fn create(path: &Path) -> io::Result<Self> {
        Ok(Self { file: File::create(path)?, failure: None })
    }

    /// Why the file could not be written; `other` if that is not what failed.
    pub fn failure_or(
        self,
        other: impl Into<Box<dyn std::error::Error + Send + Sync>>,
    ) -> io::Error {
        self.failure.unwrap_or_else(|| io::Error::other(other))
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.failure.is_some() {
            return Ok(bytes.len());
        }
        self.file.write(bytes).inspect_err(|error| {
            if error.kind() != io::ErrorKind::Interrupted {
                self.failure = Some(again(error));
            }
        })
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for OutputFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// The same error once more.
fn again(error: &io::Error) -> io::Error {
    error.raw_os_error().map_or_else(|| error.kind().into(), io::Error::from_raw_os_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_told_once_and_its_reason_kept() {
        let mut file = OutputFile::create(Path::new("/dev/full")).unwrap();
        let error = file.write(b"x").unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        assert_eq!(file.write(b"xyz").unwrap(), 3);
        assert_eq!(file.failure_or("something else").kind(), io::ErrorKind::StorageFull);
    }
}
