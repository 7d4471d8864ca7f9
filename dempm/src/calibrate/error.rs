//! Errors of calibrations.

use std::path::PathBuf;

use crate::toml_error::TomlError;

/// Targets that cannot be read, or a calibration that cannot go on.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum CalibrationError {
    /// A file cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The targets file is wrong at one place.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Invalid(#[from] TomlError),
    /// The targets file is wrong as a whole.
    #[error("{}: {problem}", path.display())]
    Targets {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// A line of a table of measurements is wrong.
    #[error("{}, line {line}: {problem}", path.display())]
    Data {
        /// The table.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What is wrong.
        problem: String,
    },
    /// Too few sets of parameters can be simulated.
    #[error("only {succeeded} of {members} sets of parameters could be simulated: {reason}")]
    #[diagnostic(help("narrow the ranges of the free parameters"))]
    Failed {
        /// Sets that could.
        succeeded: usize,
        /// All sets.
        members: usize,
        /// Why the first other one could not.
        reason: String,
    },
    /// A packing of the calibrated grains cannot be made or sheared.
    #[error("the law cannot be fitted: {0}")]
    Law(String),
    /// The GPU fails.
    #[error(transparent)]
    Gpu(#[from] Box<dem::cuda::CudaError>),
    /// The covariance of the measurements cannot be inverted.
    #[error("the standard deviations of the targets make no covariance that can be inverted")]
    Covariance,
}
