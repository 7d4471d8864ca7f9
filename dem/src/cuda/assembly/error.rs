//! Failures of assemblies on a GPU.

use cudarc::driver::DriverError;
use gpu::ranks::RanksError;

use crate::assembly::AssemblyError;

/// A failure of the device or of an assembly on it.
#[derive(Debug, thiserror::Error)]
pub enum CudaAssemblyError {
    /// A failure of the device.
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    /// Another rank is gone.
    #[error(transparent)]
    Ranks(#[from] RanksError),
    /// Ranks have prepared other discs than rank 0.
    #[error("the ranks have prepared different numbers of discs: {0:?}")]
    Differ(Vec<u64>),
    /// As on the CPU.
    #[error(transparent)]
    Assembly(#[from] AssemblyError),
    /// The sizes of grains are too unequal for the lists.
    #[error(
        "a grain can have {rows} neighbours, and at most {most} have room: radii from {radius_min} to {radius_max} m are too unequal for the GPU"
    )]
    TooUnequal {
        /// Neighbours that a grain can have.
        rows: usize,
        /// Most that have room.
        most: usize,
        /// Smallest radius (m).
        radius_min: f64,
        /// Largest radius (m).
        radius_max: f64,
    },
    /// More grains than identities.
    #[error("{0} grains are too many: identities have 32 bits")]
    TooMany(usize),
    /// A list of neighbours, bodies or discs of a bin is full.
    #[error(
        "DEM step {step}: grain {grain} has more {what} around it than there is room for; grains are pressed together too far"
    )]
    Full {
        /// DEM steps since the start.
        step: u64,
        /// Its index.
        grain: usize,
        /// What is full.
        what: &'static str,
    },
}

impl From<DriverError> for CudaAssemblyError {
    fn from(error: DriverError) -> Self {
        Self::Gpu(error.into())
    }
}
