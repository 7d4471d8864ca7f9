//! Errors of trajectory files.

use std::path::{Path, PathBuf};

use files::WriteError;

use super::write_through::system_error;

/// The result of reading or writing a trajectory.
pub type Result<T> = std::result::Result<T, TrajectoryError>;

/// An error that names the file and the place in it.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum TrajectoryError {
    /// The file cannot be opened.
    #[error("{}: cannot {action}", path.display())]
    Io {
        /// The trajectory file.
        path: PathBuf,
        /// What failed.
        action: &'static str,
        /// Why.
        source: std::io::Error,
    },
    /// The file could not be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
    /// The HDF5 library cannot read or write a dataset, a group or an attribute.
    #[error("{}: HDF5 cannot read or write {item}", path.display())]
    Hdf5 {
        /// The trajectory file.
        path: PathBuf,
        /// The dataset, group or attribute.
        item: String,
        /// The library's reason.
        source: hdf5::Error,
    },
    /// A file of another kind.
    #[error("{}: this is not an HDF5 file", path.display())]
    NotHdf5 {
        /// The file.
        path: PathBuf,
    },
    /// An HDF5 file whose end is missing.
    #[error("{}: the end of this HDF5 file is missing", path.display())]
    CutShort {
        /// The file.
        path: PathBuf,
    },
    /// An HDF5 file of another kind.
    #[error("{}: this is not a DEMPM trajectory (its attribute `format` is missing or different)", path.display())]
    NotATrajectory {
        /// The file.
        path: PathBuf,
    },
    /// A file written by a later DEMPM.
    #[error("{}: trajectory format {found}, but this program reads formats up to {known}", path.display())]
    NewerFormat {
        /// The trajectory file.
        path: PathBuf,
        /// Its format version.
        found: u64,
        /// The latest format version this program knows.
        known: u64,
    },
    /// A dataset whose shape contradicts the rest of the file.
    #[error("{}: {item} has shape {found:?}, expected {expected}", path.display())]
    Shape {
        /// The trajectory file.
        path: PathBuf,
        /// The dataset.
        item: String,
        /// Its shape.
        found: Vec<usize>,
        /// What it should have been.
        expected: String,
    },
    /// A number that cannot be.
    #[error("{}: {item} {problem}", path.display())]
    Value {
        /// The trajectory file.
        path: PathBuf,
        /// The attribute or dataset.
        item: String,
        /// The number, and what it has to be.
        problem: String,
    },
    /// A frame that the file does not have.
    #[error("{}: there is no frame {frame}; the file has {frames} (0 is the first)", path.display())]
    NoSuchFrame {
        /// The trajectory file.
        path: PathBuf,
        /// The frame asked for.
        frame: usize,
        /// The number of frames in the file.
        frames: usize,
    },
    /// A pushed frame that does not match the points or the frames before it.
    #[error("{}: frame {frame}: {reason}", path.display())]
    FrameMismatch {
        /// The trajectory file.
        path: PathBuf,
        /// The index of the frame.
        frame: usize,
        /// How it differs.
        reason: String,
    },
}

impl TrajectoryError {
    /// Attaches file and item to an error of the HDF5 library: `.map_err(at(path, "/time"))`.
    pub(super) fn at<'a>(path: &'a Path, item: &'a str) -> impl Fn(hdf5::Error) -> Self + 'a {
        move |source| Self::Hdf5 { path: path.to_owned(), item: item.to_owned(), source }
    }

    /// The same while writing, with the system's reason where there is one, such as a full disk.
    pub(super) fn writing<'a>(path: &'a Path, item: &'a str) -> impl Fn(hdf5::Error) -> Self + 'a {
        move |error| match system_error(&error) {
            Some(source) => WriteError { path: path.to_owned(), action: "write it", source }.into(),
            None => Self::at(path, item)(error),
        }
    }
}
