//! Opening HDF5 files that may be anything.

use std::fs;
use std::path::Path;

use hdf5::File;

use super::error::{Result, TrajectoryError};
use super::layout::unlocked;

/// No HDF5 file has fewer bytes.
const SHORTEST: u64 = 96;

/// Opens an HDF5 file for reading; also returns its size (bytes).
///
/// # Errors
/// If the system or HDF5 cannot open it.
pub(crate) fn open_hdf5(path: &Path) -> Result<(File, u64)> {
    // A file that is not there is a plainer error than HDF5's.
    let size = fs::metadata(path)
        .map_err(|source| TrajectoryError::Io { path: path.to_owned(), action: "open it", source })?
        .len();
    match File::with_options().with_fapl(unlocked).open(path) {
        Ok(file) => Ok((file, size)),
        Err(error) => Err(refusal(path, size, error)),
    }
}

/// What HDF5's reason means, which is in its text only.
fn refusal(path: &Path, size: u64, error: hdf5::Error) -> TrajectoryError {
    let path = path.to_owned();
    let reason = error.to_string();
    let says = |what| reason.contains(what);
    if says("file signature not found") {
        TrajectoryError::NotHdf5 { path }
    } else if size < SHORTEST || says("truncated file") {
        TrajectoryError::CutShort { path }
    } else {
        TrajectoryError::Hdf5 { path, item: "the file".to_owned(), source: error }
    }
}
