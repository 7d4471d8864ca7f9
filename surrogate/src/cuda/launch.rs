//! Helpers to launch kernels.

use cudarc::driver::{CudaStream, DevicePtr, LaunchConfig, sys::CUdeviceptr};

/// Threads of a block of kernels with one thread for each element.
const THREADS: u32 = 128;

/// One thread for each of `elements`, which is not 0.
pub(super) fn each(elements: usize) -> LaunchConfig {
    blocks((elements as u32).div_ceil(THREADS), THREADS)
}

pub(super) fn blocks(blocks: u32, threads: u32) -> LaunchConfig {
    LaunchConfig { grid_dim: (blocks, 1, 1), block_dim: (threads, 1, 1), shared_mem_bytes: 0 }
}

/// The same for each of some frames, whose number is the y of a block.
pub(super) fn of_frames(config: LaunchConfig, frames: usize) -> LaunchConfig {
    LaunchConfig { grid_dim: (config.grid_dim.0, frames as u32, 1), ..config }
}

/// Where an array is. All work is queued on one stream, so that nothing has to be waited for.
pub(super) fn address<T>(array: &impl DevicePtr<T>, stream: &CudaStream) -> CUdeviceptr {
    array.device_ptr(stream).0
}
