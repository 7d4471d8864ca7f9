//! Grids and blocks of launches.

use gpu::Launch;

/// Threads of a warp.
pub(super) const WARP: u32 = 32;
/// Threads of a block of kernels with one thread for each element.
const THREADS: u32 = 128;

/// A thread for each of `elements` of each of `frames`, whose number is the y of a block.
pub(super) fn one_thread_each(elements: usize, frames: usize) -> Launch {
    Launch::each(elements, THREADS).rows(frames as u32)
}

/// Blocks (x, y) of so many threads.
pub(super) fn blocks([x, y]: [usize; 2], threads: u32) -> Launch {
    Launch::blocks(x as u32, threads).rows(y as u32)
}
