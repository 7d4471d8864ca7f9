//! Errors of imports.

use std::path::{Path, PathBuf};

use files::{ReplacesInput, WriteError};

use super::pickle::PickleError;
use crate::dataset::DatasetError;
use crate::scene::SceneError;
use crate::trajectory::TrajectoryError;

/// An import that failed.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum ImportError {
    /// A file cannot be opened.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// There is no file of a split in a folder.
    #[error("{}: no {names} in it", path.display())]
    NoSplit {
        /// The folder.
        path: PathBuf,
        /// The names of the files.
        names: String,
    },
    /// There is no metadata beside the file.
    #[error("cannot read {}", path.display())]
    #[diagnostic(help(
        "the bounds of the domain and the time between frames are in the metadata.json of a data set, \
         beside its files"
    ))]
    NoMetadata {
        /// Where the metadata should be.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The metadata are not JSON, or lack a key.
    #[error("{}: no metadata of a data set", path.display())]
    Metadata {
        /// The file.
        path: PathBuf,
        /// The parser's reason.
        source: serde_json::Error,
    },
    /// A number in the metadata cannot be.
    #[error("{}: `{key}` {problem}", path.display())]
    Key {
        /// The file.
        path: PathBuf,
        /// The key.
        key: &'static str,
        /// What is wrong with it.
        problem: String,
    },
    /// The data are not two-dimensional.
    #[error("{place}: {found} dimensions, but this suite is two-dimensional")]
    Dimensions {
        /// The file and what in it.
        place: String,
        /// The number of dimensions found.
        found: usize,
    },
    /// An array of another shape or type.
    #[error("{place}: {problem}")]
    Shape {
        /// The file and the trajectory.
        place: String,
        /// What was found and what expected.
        problem: String,
    },
    /// An .npz file that is no archive of arrays.
    #[error("{}: not an .npz archive", path.display())]
    Archive {
        /// The file.
        path: PathBuf,
        /// The reader's reason.
        source: zip::result::ZipError,
    },
    /// An array of objects that cannot be read.
    #[error("{place}")]
    Pickle {
        /// The file and the array.
        place: String,
        /// The reader's reason.
        source: PickleError,
    },
    /// A file that HDF5 cannot read.
    #[error("{}: HDF5 cannot read {item}", path.display())]
    Hdf5 {
        /// The file.
        path: PathBuf,
        /// The group or data set.
        item: String,
        /// The library's reason.
        source: hdf5::Error,
    },
    /// A position that is no number.
    #[error("{place}: the position of particle {particle} at frame {frame} is not a finite number")]
    NotFinite {
        /// The file and the trajectory.
        place: String,
        /// The first such frame.
        frame: usize,
        /// The first such particle in it.
        particle: usize,
    },
    /// Kinematic particles that no box stands for.
    #[error("{place}: {problem}")]
    #[diagnostic(help(
        "kinematic particles become walls along the bounds, and rectangles along the axes that do not turn"
    ))]
    Bodies {
        /// The file and the trajectory.
        place: String,
        /// What does not fit.
        problem: String,
    },
    /// The output folder holds trajectories.
    #[error("{}: there are trajectories in it", path.display())]
    #[diagnostic(help("import into another folder, or delete them"))]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// The imported scene is none that this suite knows.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// A trajectory cannot be written, or an HDF5 file not be opened.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// The statistics cannot be computed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Dataset(#[from] DatasetError),
    /// A file cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
    /// An output would replace an input.
    #[error(transparent)]
    #[diagnostic(transparent)]
    ReplacesInput(#[from] ReplacesInput),
}

impl ImportError {
    /// Adds the file to an error of the system.
    pub(super) fn read(path: &Path) -> impl Fn(std::io::Error) -> Self + '_ {
        move |source| Self::Read { path: path.to_owned(), source }
    }

    /// Adds file and item to an error of the HDF5 library.
    pub(super) fn hdf5<'a>(path: &'a Path, item: &'a str) -> impl Fn(hdf5::Error) -> Self + 'a {
        move |source| Self::Hdf5 { path: path.to_owned(), item: item.to_owned(), source }
    }
}
