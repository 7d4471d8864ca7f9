//! Failures of networks on a GPU.

use cudarc::driver::DriverError;

/// Why a network could not be set up or run on a GPU.
#[derive(Debug, thiserror::Error)]
pub enum CudaError {
    /// A failure of the GPU.
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    /// A failure of the GPUs' communication.
    #[error(transparent)]
    Ranks(#[from] gpu::ranks::RanksError),
    /// The network is too large for the kernels.
    #[error(
        "`{key}` is {value}, but the kernels for GPUs have at most {most}; {}",
        if cfg!(feature = "burn-cuda") {
            "Burn computes it there in `precision = \"f32\"`"
        } else {
            "run it on the CPU, or build `surrogate` with `--features burn-cuda`"
        }
    )]
    Unsupported {
        /// Key of the network's configuration.
        key: &'static str,
        /// Its value.
        value: usize,
        /// Its largest value on a GPU.
        most: usize,
    },
    /// A precision that only GPUs have.
    #[error("bf16 needs a GPU; leave `--precision` out on the CPU")]
    Bf16OnCpu,
    /// The optimiser does not fit.
    #[error(
        "Muon needs {needed} KiB of shared memory for a block, but the GPU has {found}; leave \
         `optimiser` out of the training file"
    )]
    Muon {
        /// KiB that it needs.
        needed: usize,
        /// KiB that there are.
        found: usize,
    },
    /// A batch is too large for the buffers.
    #[error("{found} {what}, but the buffers have room for {room}")]
    Capacity {
        /// Points, edges, ...
        what: &'static str,
        /// Their number.
        found: usize,
        /// Their largest number.
        room: usize,
    },
    /// A list of weights is that of another network.
    #[error("{found} weights, but the network has {expected}")]
    Weights {
        /// Length of the list.
        found: usize,
        /// Number of weights of the network.
        expected: usize,
    },
}

impl From<DriverError> for CudaError {
    fn from(error: DriverError) -> Self {
        Self::Gpu(error.into())
    }
}
