//! What can go wrong on a GPU.

use cudarc::driver::DriverError;

use crate::error::Failure;

/// Why one RVE of a batch stands still.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RveFailure {
    #[error(transparent)]
    Packing(#[from] Failure),
    #[error(
        "a disc has more than {rows} discs within reach, or one more than 32 periods away; the packing is compressed too far, or the Verlet skin is too large for discs this unequal"
    )]
    ListFull { rows: usize },
    #[error(
        "more than {slots} touching or nearly touching neighbours over all discs; the packing is compressed too far, or needs `neighbours = \"ample\"` in [material]"
    )]
    SlotsFull { slots: usize },
}

/// A failure of the device or of an RVE on it.
#[derive(Debug, thiserror::Error)]
pub enum CudaError {
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    #[error(
        "an RVE of {discs} discs does not fit this GPU in {precision}; at most {most} discs do"
    )]
    TooManyDiscs { discs: usize, most: usize, precision: &'static str },
    #[error(
        "RVE {rve} has {found} discs and the fresh packing has {expected}; all must have as many"
    )]
    Unequal { rve: usize, found: usize, expected: usize },
    #[error("RVE {rve}, macro step {step} since the upload: {failure}")]
    Rve { rve: usize, step: usize, failure: RveFailure },
}

impl From<DriverError> for CudaError {
    fn from(error: DriverError) -> Self {
        Self::Gpu(error.into())
    }
}
