//! Errors of exports.

use std::path::{Path, PathBuf};

use files::{ReplacesInput, WriteError};

use crate::dataset::DatasetError;
use crate::trajectory::{TrajectoryError, system_error};

/// An export that failed.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum ExportError {
    /// The trajectory cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// A file cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
    /// The data set cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Dataset(#[from] DatasetError),
    /// A file to be written is one of the inputs.
    #[error(transparent)]
    #[diagnostic(transparent)]
    ReplacesInput(#[from] ReplacesInput),
    /// A position or velocity is no number.
    #[error("{}: the {field} of point {point} at frame {frame} is not a finite number", path.display())]
    #[diagnostic(help(
        "`dempm info` counts such values; the run that made the file has failed there"
    ))]
    NotFinite {
        /// The trajectory file.
        path: PathBuf,
        /// Name of the field.
        field: &'static str,
        /// The first such frame.
        frame: usize,
        /// The first such point in it.
        point: usize,
    },
    /// A box is not there at all times.
    #[error("{}: box {index} is absent at frame {frame}", path.display())]
    #[diagnostic(help("gns and LagrangeBench know only particles that are always there"))]
    AbsentBox {
        /// The trajectory file.
        path: PathBuf,
        /// The first such frame.
        frame: usize,
        /// The box.
        index: usize,
    },
    /// A trajectory without frames.
    #[error("{}: the file has no frames", path.display())]
    NoFrames {
        /// The trajectory file.
        path: PathBuf,
    },
    /// The trajectory has no grains.
    #[error("{}: the file has no grains", path.display())]
    #[diagnostic(help(
        "[output] grains_every in a scene of discs records them; ParaView opens the points of the \
         file as it is"
    ))]
    NoGrains {
        /// The trajectory file.
        path: PathBuf,
    },
    /// A position or velocity of a grain is no number.
    #[error("{}: the {field} of grain {grain} at frame {frame} is not a finite number", path.display())]
    GrainNotFinite {
        /// The trajectory file.
        path: PathBuf,
        /// Position or velocity.
        field: &'static str,
        /// The first such frame.
        frame: usize,
        /// The first such grain in it.
        grain: usize,
    },
    /// HDF5 cannot write the file.
    #[error("{}: HDF5 cannot write it", path.display())]
    Hdf5 {
        /// The file.
        path: PathBuf,
        /// The library's reason.
        source: hdf5::Error,
    },
}

impl ExportError {
    /// Adds the file to an error of the system.
    pub(super) fn at(path: &Path) -> impl Fn(std::io::Error) -> Self + '_ {
        move |source| Self::Write(WriteError::at(path, "write it")(source))
    }

    /// Adds the file to an error of the HDF5 library.
    pub(super) fn hdf5(path: &Path) -> impl Fn(hdf5::Error) -> Self + '_ {
        move |source| match system_error(&source) {
            Some(source) => Self::at(path)(source),
            None => Self::Hdf5 { path: path.to_owned(), source },
        }
    }
}
