//! Arguments of `bins.cu`: the end of a step, for the next one.

use gpu::kernel;

use super::abi::Mpm;

kernel! {
    /// Basis functions at all points, which are pushed into the bins.
    pub struct EvaluateBasis: evaluate_basis {
        /// The solver.
        pub m: Mpm,
    }

    /// Ascending lists of the points of each bin.
    pub struct SortBins: sort_bins {
        /// The solver.
        pub m: Mpm,
    }
}
