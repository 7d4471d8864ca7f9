//! How a material queues its kernels.

use cudarc::driver::{CudaStream, CudaView};
use gpu::{Function, Kernel, Launch};

use super::abi::Mpm;
use super::error::CudaError;

/// Threads of a block, with one thread for each point, or several for each node.
const BLOCK: u32 = 128;

/// Stream and data for the kernels of a material.
pub struct Queue<'a> {
    /// Where kernels are queued.
    pub stream: &'a CudaStream,
    /// The step (s).
    pub dt: f64,
    /// Number of points.
    pub points: usize,
    /// The solver: argument of kernels that include [`header`](super::header).
    pub mpm: &'a Mpm,
    /// Velocity gradients of all points (1/s): xx, xy, yx, yy of each.
    pub velocity_gradient: CudaView<'a, f64>,
}

impl Queue<'_> {
    /// Queues a kernel with one thread a point, which begins with `point_of_thread`.
    ///
    /// # Errors
    /// The launch was refused.
    ///
    /// # Safety
    /// As [`Function::launch`].
    pub unsafe fn over_points<K: Kernel>(
        &self,
        kernel: &Function<K>,
        arguments: &K,
    ) -> Result<(), CudaError> {
        // SAFETY: the caller's.
        Ok(unsafe { kernel.launch(self.stream, each(self.points), arguments) }?)
    }
}

/// Launch of `count` threads, for a kernel that depends on the one before it only. Urgent: all kernels are
/// small, and the packings of the scene wait for them.
pub(super) fn each(count: usize) -> Launch {
    Launch::each(count, BLOCK).early(true).urgent()
}
