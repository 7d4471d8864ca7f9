//! Arguments of `budget.cu`.

use gpu::{Pointer, kernel};

/// Threads of a block: a power of two.
pub(super) const SUM_THREADS: u32 = 256;

kernel! {
    /// Adds what nodes or points have booked to the total, and clears it. One block of [`SUM_THREADS`]
    /// for each quantity.
    pub struct SumLedger: sum_ledger {
        /// Quantities x `slots`.
        pub ledger: Pointer<f64>,
        /// Number of nodes, or of points.
        pub slots: i32,
        /// Totals of the quantities.
        pub total: Pointer<f64>,
    }
}
