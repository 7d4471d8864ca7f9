//! Arguments of `search.cu`: bins and lists of neighbours, where a search is due or forced.

use gpu::kernel;

use super::abi::{Arrays, Parameters};
use crate::cuda::real::CudaReal;

kernel! {
    /// Places bodies at the start of a sequence of steps.
    pub(super) struct Begin<R: CudaReal>: assembly_begin {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
    }

    /// Looks whether discs rest, and puts every disc into its bin.
    pub(super) struct Bins<R: CudaReal>: assembly_bins {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// Whether to search in any case.
        pub force: u32,
    }

    /// Lists the neighbours of every disc.
    pub(super) struct List<R: CudaReal>: assembly_list {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// Whether to search in any case.
        pub force: u32,
    }

    /// Ends a round of steps.
    pub(super) struct Finish<R: CudaReal>: assembly_finish {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// Whether the search was forced.
        pub force: u32,
    }
}
