//! Arguments of `step.cu`: one DEM step.

use gpu::kernel;

use super::abi::{Arrays, Parameters};
use crate::cuda::real::CudaReal;

kernel! {
    /// One DEM step of all discs, unless the lists are outdated.
    pub(super) struct Step<R: CudaReal>: assembly_step {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// Number of the step in its round.
        pub k: u32,
    }
}
