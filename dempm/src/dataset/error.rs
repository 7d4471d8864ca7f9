//! Errors of data sets.

use std::path::PathBuf;

use files::WriteError;

use crate::scene::SceneError;
use crate::trajectory::TrajectoryError;

/// A data set that cannot be made or read.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum DatasetError {
    /// A list, scene or folder cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A list or its base scene is not valid TOML or has unknown keys.
    #[error("{}: not a list of scenes", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// The parser's reason.
        source: toml::de::Error,
    },
    /// A key of a list is wrong.
    #[error("{}: `{key}` {reason}", path.display())]
    #[diagnostic(help("docs/datasets.md describes lists of scenes"))]
    Key {
        /// The list.
        path: PathBuf,
        /// The key with its block, such as `train[0].grid.duration`.
        key: String,
        /// What is wrong.
        reason: String,
    },
    /// A scene of a list is invalid.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// A selection without cases.
    #[error("{}: no scene {selection}", path.display())]
    NoScene {
        /// The list, or `paper`.
        path: PathBuf,
        /// The selection.
        selection: String,
    },
    /// A folder without trajectories.
    #[error("{}: no trajectory (*.h5) in it or in its folders train, valid, test", path.display())]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// A trajectory of an unfinished run.
    #[error("{}: its run is not finished: {status}", path.display())]
    #[diagnostic(help("finish the run, or move the file out of the data set"))]
    Unfinished {
        /// The trajectory file.
        path: PathBuf,
        /// Status of the run.
        status: String,
    },
    /// There is no training trajectory.
    #[error("there is no training trajectory to compute statistics of")]
    NothingToTrain,
    /// Two training trajectories do not fit together.
    #[error("{} and {} differ in {what}", one.display(), other.display())]
    Differ {
        /// A trajectory file.
        one: PathBuf,
        /// Another one.
        other: PathBuf,
        /// The property in which they differ.
        what: &'static str,
    },
    /// Two training scenes have different frame intervals.
    #[error(
        "{}: train/{one} and train/{other} differ in `frame_interval`, {} s and {} s",
        path.display(), values.0, values.1
    )]
    #[diagnostic(help(
        "a model learns one interval: give all [[train]] cases the same, or make two data sets"
    ))]
    Intervals {
        /// The list.
        path: PathBuf,
        /// Name of a case.
        one: String,
        /// Name of another case.
        other: String,
        /// Their frame intervals (s).
        values: (f64, f64),
    },
    /// A trajectory exists that is neither to be resumed nor overwritten.
    #[error("{}: is there already", path.display())]
    #[diagnostic(help(
        "--resume keeps what is finished and makes the rest, --overwrite starts again"
    ))]
    Exists {
        /// The trajectory file.
        path: PathBuf,
    },
    /// An existing trajectory was made from a different scene.
    #[error("{}: made from a scene that differs from the one in the list", path.display())]
    #[diagnostic(help("write to another folder, or start again with --overwrite"))]
    OtherScene {
        /// The trajectory file.
        path: PathBuf,
    },
    /// An existing trajectory cannot be read.
    #[error("{}: cannot be read, it may be damaged", path.display())]
    #[diagnostic(help("delete it, and --resume makes it again"))]
    Damaged {
        /// The trajectory file.
        path: PathBuf,
        /// The reader's reason.
        source: TrajectoryError,
    },
    /// A trajectory cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// A file cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
}
