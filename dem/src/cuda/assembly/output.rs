//! Arguments of `output.cu`: states of the grains.

use gpu::{Pointer, kernel};

use super::abi::{self, Arrays, Parameters};
use crate::cuda::real::CudaReal;

kernel! {
    /// States in the order of identities.
    pub(super) struct WriteOutput<R: CudaReal>: assembly_output {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// One state for each grain that can move.
        pub output: Pointer<abi::Output<R>>,
    }
}
