//! What can go wrong on a GPU.

use cudarc::driver::DriverError;

/// A failure of the device, or of a step on it.
#[derive(Debug, thiserror::Error)]
pub enum CudaError {
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    /// As the CPU says it; `step` counts from the start of the run.
    #[error("step {step}: {source}")]
    Step { step: usize, source: crate::Error },
}

impl From<DriverError> for CudaError {
    fn from(error: DriverError) -> Self {
        Self::Gpu(error.into())
    }
}
