//! Errors in training data.

use std::path::PathBuf;

use dempm::scene::SceneError;
use dempm::trajectory::TrajectoryError;

use crate::features::MissingField;

/// Training data that cannot be used.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum DataError {
    /// The folder cannot be listed.
    #[error("{}: cannot list the folder", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The error of the file system.
        source: std::io::Error,
    },
    /// A file of the folder cannot be read.
    #[error("{}: cannot read it", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The error of the file system.
        source: std::io::Error,
    },
    /// The folder has no trajectory in it.
    #[error("{}: no trajectory files (*.h5) in this folder", path.display())]
    #[diagnostic(help("make some with `dempm run SCENE.toml -o FOLDER/NAME.h5`"))]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// A trajectory cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// The scene in a trajectory is invalid.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// A trajectory with too few frames.
    #[error("{}: {found} frames, but a window with stride {stride} needs {needed}", path.display())]
    TooShort {
        /// The trajectory file.
        path: PathBuf,
        /// Its frames.
        found: usize,
        /// Frames of the file per frame of a window.
        stride: usize,
        /// Frames that a window and its target span.
        needed: usize,
    },
    /// A position is NaN or infinite.
    #[error("{}: frame {frame}: the position of point {point} is not finite", path.display())]
    NotFinite {
        /// The trajectory file.
        path: PathBuf,
        /// The frame.
        frame: usize,
        /// Index of the point.
        point: usize,
    },
    /// A trajectory lacks a field that a node feature needs.
    #[error("{}", path.display())]
    #[diagnostic(help("list it in `output.fields` of the scene, or not in `model.node_features`"))]
    Field {
        /// The trajectory file.
        path: PathBuf,
        /// The field.
        source: MissingField,
    },
    /// A trajectory whose domain or frame interval differs from the others.
    #[error("{}: {what} is {found}, but {} has {expected}", path.display(), other.display())]
    #[diagnostic(help("all trajectories of a training need the same domain and frame interval"))]
    Mixed {
        /// The trajectory file.
        path: PathBuf,
        /// The file it is compared with.
        other: PathBuf,
        /// What differs.
        what: &'static str,
        /// Its value in `path`.
        found: String,
        /// Its value in `other`.
        expected: String,
    },
}
