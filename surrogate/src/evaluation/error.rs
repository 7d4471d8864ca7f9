//! Comparisons that cannot be made.

use std::path::PathBuf;

use dempm::trajectory::TrajectoryError;

use crate::rollout::InitialFramesError;

/// A comparison that cannot be made.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum EvaluationError {
    /// A trajectory cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// The model cannot start from a trajectory.
    #[error(transparent)]
    #[diagnostic(transparent)]
    InitialFrames(#[from] InitialFramesError),
    /// Two runs are of different scenes.
    #[error("{} is not a run of the scene of {}", other.display(), path.display())]
    OtherScene {
        /// A run.
        path: PathBuf,
        /// What should be a run of its scene.
        other: PathBuf,
    },
    /// Runs of a scene differ in their points.
    #[error("{} and {} have different points", path.display(), other.display())]
    OtherPoints {
        /// A run.
        path: PathBuf,
        /// Another one.
        other: PathBuf,
    },
}
