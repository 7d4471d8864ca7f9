//! Errors of sessions.

use std::path::PathBuf;

use files::{LockError, WriteError};
use gpu::ranks::RanksError;

use super::checkpoint::CheckpointError;
use crate::simulation::SimulationError;
use crate::trajectory::TrajectoryError;

/// A session that could not begin or had to stop.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum SessionError {
    /// The trajectory or its checkpoint exists, and should neither be continued nor replaced.
    #[error("{}: the run already exists", path.display())]
    #[diagnostic(help("--resume continues an interrupted run, --overwrite starts again"))]
    Exists {
        /// The trajectory file.
        path: PathBuf,
    },
    /// The trajectory is no unfinished run of this scene.
    #[error("{}: nothing to resume, this run is: {status}", path.display())]
    #[diagnostic(help("--overwrite starts again"))]
    NothingToResume {
        /// The trajectory file.
        path: PathBuf,
        /// Its status.
        status: String,
    },
    /// Another process writes the trajectory.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Lock(#[from] LockError),
    /// The checkpoint cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The trajectory cannot be created or continued.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// Trajectory or checkpoint cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Writer(#[from] WriterError),
    /// A file cannot be removed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
    /// The simulation cannot be set up, or failed on a rank that does not write.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Simulation(#[from] SimulationError),
    /// Another rank is gone or has failed.
    #[error(transparent)]
    Ranks(#[from] RanksError),
    /// The simulation failed; the trajectory holds the frames before.
    #[error("{}: holds the {frames} frames before the failure", path.display())]
    Failed {
        /// The trajectory file.
        path: PathBuf,
        /// The number of frames in it.
        frames: usize,
        /// The failure.
        source: SimulationError,
    },
}

/// A trajectory or checkpoint that could not be written.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum WriterError {
    /// The trajectory.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// The checkpoint.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Checkpoint(#[from] CheckpointError),
}
