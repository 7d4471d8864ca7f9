//! What can go wrong with a data set.

use std::path::PathBuf;

use files::WriteError;

use crate::trajectory::TrajectoryError;

/// An error that names the file, and the key in it.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum DatasetError {
    #[error("cannot read {}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{}: not a list of scenes", path.display())]
    Syntax { path: PathBuf, source: toml::de::Error },
    #[error("{}: `{key}` {reason}", path.display())]
    #[diagnostic(help("docs/datasets.md describes lists of scenes"))]
    Key { path: PathBuf, key: String, reason: String },
    #[error("{}: no trajectory (*.h5) in it or in its folders train, valid, test", path.display())]
    Empty { path: PathBuf },
    #[error("{}: its run is not finished: {status}", path.display())]
    #[diagnostic(help("finish it first, or move it out of the data set"))]
    Unfinished { path: PathBuf, status: String },
    #[error("there is no training trajectory to take statistics of")]
    NothingToTrain,
    #[error("{} and {} differ in {what}", one.display(), other.display())]
    Differ { one: PathBuf, other: PathBuf, what: &'static str },
    #[error(
        "{}: train/{one} and train/{other} differ in `frame_interval`, {} s and {} s",
        path.display(), values.0, values.1
    )]
    #[diagnostic(help(
        "one model learns one interval: give all [[train]] cases the same, or make two data sets"
    ))]
    Intervals { path: PathBuf, one: String, other: String, values: (f64, f64) },
    #[error("{}: made from another scene than the one of this name in the list", path.display())]
    #[diagnostic(help("write to another folder, or start again with --overwrite"))]
    OtherScene { path: PathBuf },
    #[error("{}: cannot be read, it may be damaged", path.display())]
    #[diagnostic(help("delete it, and the same command makes it again"))]
    Damaged { path: PathBuf, source: TrajectoryError },
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
}
