//! Arguments of `sleep.cu`: which discs rest.

use gpu::kernel;

use super::abi::{Arrays, Parameters};
use crate::cuda::real::CudaReal;

kernel! {
    /// Looks which discs rest.
    pub(super) struct LookAtRest<R: CudaReal>: assembly_look {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
    }

    /// Looks around which of them nothing moves.
    pub(super) struct Quiet<R: CudaReal>: assembly_quiet {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// Whether to look even if no steps were made.
        pub force: u32,
    }
}
