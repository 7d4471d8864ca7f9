//! Arguments of `cell_average.cu`: cell averages of the volumetric strain rate, in four kernels.

use gpu::kernel;

use super::abi::Mpm;

kernel! {
    /// Pushes all points into the bins of their cells.
    pub struct CellPush: cell_push {
        /// The solver.
        pub m: Mpm,
    }

    /// Ascending lists of the points of each cell.
    pub struct CellSort: cell_sort {
        /// The solver.
        pub m: Mpm,
    }

    /// Sums over the points of each cell.
    pub struct CellSums: cell_sums {
        /// The solver.
        pub m: Mpm,
    }

    /// Replaces the trace of each velocity gradient by the average over the cell.
    pub struct CellAverage: cell_average {
        /// The solver.
        pub m: Mpm,
    }
}
