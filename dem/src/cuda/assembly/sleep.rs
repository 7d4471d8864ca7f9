//! Arguments of `sleep.cu`: which discs rest.

use gpu::kernel;

use super::abi::{Arrays, Parameters};
use crate::cuda::real::CudaReal;

kernel! {
    /// Looks around which of the discs that rest nothing moves.
    pub(super) struct Quiet<R: CudaReal>: assembly_quiet {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// Whether to look even if no steps were made.
        pub force: u32,
    }
}
