//! HDF5 files without write caches.

use std::io;
use std::mem::ManuallyDrop;
use std::ops::Deref;
use std::path::Path;

use hdf5::file::FileAccessBuilder;
use hdf5::{File, FileBuilder};

/// An HDF5 file without write caches: a full disk is an error of the write that hits it.
///
/// By default HDF5 writes cached data when their dataset is closed. If that fails, no error is returned,
/// the data are lost, and the half-closed dataset crashes the program when the next file is flushed.
///
/// Only [`close`](Self::close) closes the file. A file given up after an error stays open until the
/// program ends, since closing it would repeat the failed write.
#[derive(Debug)]
pub(crate) struct WriteThrough(ManuallyDrop<File>);

impl WriteThrough {
    /// Creates an empty file; `choose` adds to its access properties.
    pub fn create(
        path: &Path,
        choose: impl Fn(&mut FileAccessBuilder) -> &mut FileAccessBuilder,
    ) -> hdf5::Result<Self> {
        // Same run, same bytes: no time stamps.
        let mut options = options(choose);
        let file = options.with_fcpl(|create| create.obj_track_times(false)).create(path)?;
        Ok(Self(ManuallyDrop::new(file)))
    }

    /// Opens a file for changes.
    pub fn open(
        path: &Path,
        choose: impl Fn(&mut FileAccessBuilder) -> &mut FileAccessBuilder,
    ) -> hdf5::Result<Self> {
        Ok(Self(ManuallyDrop::new(options(choose).open_rw(path)?)))
    }

    /// Writes the metadata and closes the file.
    pub fn close(self) -> hdf5::Result<()> {
        // A flush may fail and leave the file open; a close that fails does not.
        self.0.flush()?;
        ManuallyDrop::into_inner(self.0).close()
    }
}

impl Deref for WriteThrough {
    type Target = File;

    fn deref(&self) -> &File {
        &self.0
    }
}

/// Access without a chunk cache and a sieve buffer, and with the properties of `choose`.
fn options(choose: impl Fn(&mut FileAccessBuilder) -> &mut FileAccessBuilder) -> FileBuilder {
    let mut options = File::with_options();
    options.with_fapl(|access| choose(access.chunk_cache(0, 0, 0.0).sieve_buf_size(0)));
    options
}

/// The system error behind an error of HDF5, if any.
pub(crate) fn system_error(error: &hdf5::Error) -> Option<io::Error> {
    // The error number is only in the text: `..., errno = 28, error message = 'No space left on device'`.
    let text =
        error.stack()?.iter().rev().find_map(|frame| {
            frame.desc().split_once("errno = ").map(|(_, rest)| rest.to_owned())
        })?;
    let digits = text.split(|c: char| !c.is_ascii_digit()).next()?;
    digits.parse().ok().map(io::Error::from_raw_os_error)
}
