//! HDF5 files on a disk that may fill up.

use std::io;
use std::mem::ManuallyDrop;
use std::ops::Deref;
use std::path::Path;

use hdf5::file::FileAccessBuilder;
use hdf5::{File, FileBuilder};

/// An HDF5 file being written, which says at once when the disk does not take it.
///
/// HDF5 keeps data back and writes them when their dataset is closed. If that fails, nobody is
/// told, the data are lost, and the half closed dataset crashes the program when the next file is
/// flushed. So nothing is kept back: a write that fails is an error of that write.
///
/// Only [`close`](Self::close) closes the file. One that is given up stays open until the program
/// ends, since to close it would mean to write once more what could not be written.
#[derive(Debug)]
pub(crate) struct WriteThrough(ManuallyDrop<File>);

impl WriteThrough {
    /// Makes an empty file; `choose` adds to the properties with which it is opened.
    pub fn create(
        path: &Path,
        choose: impl Fn(&mut FileAccessBuilder) -> &mut FileAccessBuilder,
    ) -> hdf5::Result<Self> {
        // Same run, same bytes: no time stamps.
        let mut options = options(choose);
        let file = options.with_fcpl(|create| create.obj_track_times(false)).create(path)?;
        Ok(Self(ManuallyDrop::new(file)))
    }

    /// Opens a file to be changed.
    pub fn open(
        path: &Path,
        choose: impl Fn(&mut FileAccessBuilder) -> &mut FileAccessBuilder,
    ) -> hdf5::Result<Self> {
        Ok(Self(ManuallyDrop::new(options(choose).open_rw(path)?)))
    }

    /// Writes what is left, the metadata, and closes the file.
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

/// How files are opened: no cache of chunks, no buffer for what is not in chunks, and what `choose` adds.
fn options(choose: impl Fn(&mut FileAccessBuilder) -> &mut FileAccessBuilder) -> FileBuilder {
    let mut options = File::with_options();
    options.with_fapl(|access| choose(access.chunk_cache(0, 0, 0.0).sieve_buf_size(0)));
    options
}

/// Why the system refused something to HDF5, if it was the system.
pub(crate) fn system_error(error: &hdf5::Error) -> Option<io::Error> {
    // The number is only in the text: `..., errno = 28, error message = 'No space left on device'`.
    let text =
        error.stack()?.iter().rev().find_map(|frame| {
            frame.desc().split_once("errno = ").map(|(_, rest)| rest.to_owned())
        })?;
    let digits = text.split(|c: char| !c.is_ascii_digit()).next()?;
    digits.parse().ok().map(io::Error::from_raw_os_error)
}
