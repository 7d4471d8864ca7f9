//! Arguments of `losses.cu`: sums of what was lost.

use gpu::{Pointer, kernel};

use super::abi::{Arrays, Parameters};
use crate::cuda::real::CudaReal;

/// Threads of a block.
pub(super) const SUM_THREADS: u32 = 256;
/// Kinds of losses: dashpots, friction, damping, and what boxes supply.
pub(super) const LOSSES: usize = 4;

kernel! {
    /// Adds the losses of the last sequence of steps to the totals.
    pub(super) struct SumLosses<R: CudaReal>: assembly_losses {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// Totals of each block (J).
        pub total: Pointer<f64>,
    }
}
