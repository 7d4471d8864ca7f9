//! A file for encoders that hide the reason of a failed write.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

/// A file that reports a failed write once and keeps its reason, which not every encoder passes on.
/// Later writes succeed without effect, since some encoders write again when they are dropped.
#[derive(Debug)]
pub struct OutputFile {
    file: File,
    failure: Option<io::Error>,
}

impl OutputFile {
    /// Creates an empty file.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn create(path: &Path) -> io::Result<Self> {
        Ok(Self { file: File::create(path)?, failure: None })
    }

    /// The reason of the failed write; `other` if none has failed.
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
                self.failure = Some(copy_of(error));
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

/// A copy of the error, which is not `Clone`.
fn copy_of(error: &io::Error) -> io::Error {
    error.raw_os_error().map_or_else(|| error.kind().into(), io::Error::from_raw_os_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_reported_once_and_its_reason_kept() {
        let mut file = OutputFile::create(Path::new("/dev/full")).unwrap();
        let error = file.write(b"x").unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        assert_eq!(file.write(b"xyz").unwrap(), 3);
        assert_eq!(file.failure_or("something else").kind(), io::ErrorKind::StorageFull);
    }
}
