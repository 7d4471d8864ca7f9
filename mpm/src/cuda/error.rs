//! Failures of the solver on a GPU.

use cudarc::driver::DriverError;

/// A failure of the device, or of a step on it.
#[derive(Debug, thiserror::Error)]
pub enum CudaError {
    /// A failure of the device.
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    /// A step failed as it would on the CPU.
    #[error("step {step}: {source}")]
    Step {
        /// Number of the step since the start of the run.
        step: usize,
        /// Why.
        source: crate::Error,
    },
}

impl From<DriverError> for CudaError {
    fn from(error: DriverError) -> Self {
        Self::Gpu(error.into())
    }
}
