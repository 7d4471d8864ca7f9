//! What can go wrong with a data set.

use std::path::PathBuf;

use crate::trajectory::{TrajectoryError, WriteError};

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
    #[error("{}: made from another scene than the one of this name in the list", path.display())]
    #[diagnostic(help("write to another folder, or start again with --overwrite"))]
    OtherScene { path: PathBuf },
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
}
