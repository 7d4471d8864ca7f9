//! Failures of RVEs on a GPU.

use cudarc::driver::DriverError;

use crate::error::Failure;

/// Why one RVE of a batch stands still.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RveFailure {
    /// As on the CPU.
    #[error(transparent)]
    Packing(#[from] Failure),
    /// A disc has too many neighbours.
    #[error(
        "a disc has more than {rows} discs within reach, or one more than 32 periods away; the packing is compressed too far, or the Verlet skin is too large for discs this unequal"
    )]
    ListFull {
        /// Most neighbours of one disc.
        rows: usize,
    },
    /// All discs together have too many neighbours.
    #[error(
        "all discs together have more than {slots} neighbours within reach; the packing is compressed too far, or needs `neighbours = \"ample\"` in [material]"
    )]
    SlotsFull {
        /// Most pairs of one RVE.
        slots: usize,
    },
}

/// A failure of the device or of an RVE on it.
#[derive(Debug, thiserror::Error)]
pub enum CudaError {
    /// A failure of the device.
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    /// The discs of an RVE do not fit in one thread block.
    #[error("an RVE of {discs} discs does not fit this GPU in {precision}; at most {most} do")]
    TooManyDiscs {
        /// Discs of an RVE.
        discs: usize,
        /// Most discs that fit.
        most: usize,
        /// Working precision.
        precision: &'static str,
    },
    /// RVEs of a batch differ in their number of discs.
    #[error("RVE {rve} has {found} discs, but the fresh packing has {expected}")]
    Unequal {
        /// Index of the RVE.
        rve: usize,
        /// Its discs.
        found: usize,
        /// Discs of the fresh packing.
        expected: usize,
    },
    /// An RVE failed.
    #[error("RVE {rve}, macro step {step} since the upload: {failure}")]
    Rve {
        /// Its index.
        rve: usize,
        /// Macro steps since the upload.
        step: usize,
        /// Why.
        failure: RveFailure,
    },
}

impl From<DriverError> for CudaError {
    fn from(error: DriverError) -> Self {
        Self::Gpu(error.into())
    }
}
