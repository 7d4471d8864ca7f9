//! Files that are read back by the program that wrote them, with a hash that shows any damage.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Bytes of a BLAKE3 hash.
const HASH: usize = 32;

/// A sealed file that cannot be used.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum SealError {
    /// The system could not read it.
    #[error("{}: cannot read it", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The hash at its end is not that of its contents.
    #[error("{}: damaged, or not written by this version of DEMPM", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
    },
}

/// Hashes everything that is written through it; [`seal`](Self::seal) appends the hash.
#[derive(Debug)]
pub struct SealedWriter<W> {
    inner: W,
    hasher: blake3::Hasher,
}

impl<W: Write> SealedWriter<W> {
    /// An unsealed file so far without contents.
    pub fn new(inner: W) -> Self {
        Self { inner, hasher: blake3::Hasher::new() }
    }

    /// Appends the hash of the contents.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn seal(mut self) -> io::Result<W> {
        self.inner.write_all(self.hasher.finalize().as_bytes())?;
        Ok(self.inner)
    }
}

impl<W: Write> Write for SealedWriter<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.hasher.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

/// Contents with their hash behind them, as [`SealedWriter`] writes them.
pub fn seal(mut contents: Vec<u8>) -> Vec<u8> {
    let hash = blake3::hash(&contents);
    contents.extend_from_slice(hash.as_bytes());
    contents
}

/// The contents of a sealed file.
///
/// # Errors
/// If it cannot be read, or any bit of it has changed.
pub fn read_sealed(path: &Path) -> Result<Vec<u8>, SealError> {
    let mut bytes =
        fs::read(path).map_err(|source| SealError::Read { path: path.to_owned(), source })?;
    let damaged = || SealError::Damaged { path: path.to_owned() };
    let length = bytes.len().checked_sub(HASH).ok_or_else(damaged)?;
    if blake3::hash(&bytes[..length]).as_bytes()[..] != bytes[length..] {
        return Err(damaged());
    }
    bytes.truncate(length);
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_flipped_bit_and_any_cut_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        let contents = b"all that a run needs to go on".to_vec();
        let mut writer = SealedWriter::new(Vec::new());
        writer.write_all(&contents).unwrap();
        let sealed = writer.seal().unwrap();
        assert_eq!(sealed, seal(contents.clone()));
        fs::write(&path, &sealed).unwrap();
        assert_eq!(read_sealed(&path).unwrap(), contents);
        for bit in 0..8 * sealed.len() {
            let mut damaged = sealed.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            fs::write(&path, damaged).unwrap();
            let error = read_sealed(&path).unwrap_err().to_string();
            assert!(error.contains("state: damaged"), "{error}");
        }
        for length in 0..sealed.len() {
            fs::write(&path, &sealed[..length]).unwrap();
            assert!(read_sealed(&path).is_err(), "cut to {length} bytes");
        }
    }
}
