//! Arguments of `sort.cu`: memory in the order of bins.

use gpu::{ConstPointer, Pointer, kernel};

use super::abi::{Arrays, Parameters};
use crate::cuda::real::CudaReal;

/// Threads of the blocks that sum up bins, and bins of one block.
pub(super) const SCAN_THREADS: u32 = 1024;
pub(super) const CHUNK: usize = 8 * SCAN_THREADS as usize;

kernel! {
    /// Number of discs in each chunk of bins.
    pub(super) struct Count<R: CudaReal>: assembly_count {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// Discs in each chunk.
        pub chunk: Pointer<u32>,
    }

    /// Number of discs before each chunk.
    pub(super) struct Scan: assembly_scan {
        /// From the discs in each chunk.
        pub chunk: Pointer<u32>,
        /// Number of chunks.
        pub chunks: u32,
    }

    /// Number of discs before each bin.
    pub(super) struct Starts<R: CudaReal>: assembly_starts {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// Discs before each chunk.
        pub chunk: ConstPointer<u32>,
        /// Discs before each bin.
        pub start: Pointer<u32>,
    }

    /// Number of discs before each column of tiles.
    pub(super) struct Columns<R: CudaReal>: assembly_columns {
        /// Constants.
        pub p: Parameters<R>,
        /// Discs before each bin.
        pub start: ConstPointer<u32>,
        /// Discs before each column.
        pub column: Pointer<u32>,
    }

    /// New place of every disc.
    pub(super) struct Places<R: CudaReal>: assembly_places {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// Discs before each bin.
        pub start: ConstPointer<u32>,
        /// New place of each disc.
        pub place_of: Pointer<u32>,
        /// Disc at each new place.
        pub disc_at: Pointer<u32>,
    }

    /// Copies all discs to their new places.
    pub(super) struct Reorder<R: CudaReal>: assembly_reorder {
        /// In the old order.
        pub a: Arrays<R>,
        /// In the new order.
        pub b: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// New place of each disc.
        pub place_of: ConstPointer<u32>,
        /// Disc at each new place.
        pub disc_at: ConstPointer<u32>,
    }
}
