//! What can go wrong with a network on a GPU.

use cudarc::driver::DriverError;

/// Why a network could not be set up or run on a GPU.
#[derive(Debug, thiserror::Error)]
pub enum CudaError {
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    #[error(transparent)]
    Ranks(#[from] gpu::ranks::RanksError),
    #[error(
        "`{key}` is {value}, but networks on a GPU have at most {most}; run it on the CPU instead"
    )]
    Unsupported { key: &'static str, value: usize, most: usize },
    #[error("bf16 needs a GPU, and this is computed on the CPU; leave `--precision` out")]
    Bf16OnCpu,
    #[error("{found} {what}, but the buffers have room for {room}")]
    Room { what: &'static str, found: usize, room: usize },
    #[error("{found} weights, but the network has {expected}")]
    Weights { found: usize, expected: usize },
}

impl From<DriverError> for CudaError {
    fn from(error: DriverError) -> Self {
        Self::Gpu(error.into())
    }
}
