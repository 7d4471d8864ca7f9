//! Arguments of `energy.cu`: the energy of the grains.

use gpu::{ConstPointer, Pointer, kernel};

use super::abi::{Output, Parameters, Surroundings};
use crate::cuda::real::CudaReal;

/// Threads of a block.
pub(super) const SUM_THREADS: u32 = 256;
/// Kinds of energy: kinetic, potential and elastic.
pub(super) const ENERGIES: usize = 3;

kernel! {
    /// Sums over blocks of [`SUM_THREADS`] grains.
    pub(super) struct SumEnergy<R: CudaReal>: assembly_energy {
        /// Constants.
        pub p: Parameters<R>,
        /// Gravity.
        pub around: Surroundings,
        /// States of the grains.
        pub grain: ConstPointer<Output<R>>,
        /// Number of grains.
        pub grains: u32,
        /// Energy of each block (J).
        pub energy: Pointer<f64>,
    }
}
