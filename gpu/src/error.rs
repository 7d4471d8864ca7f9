//! What can go wrong on a GPU.

use cudarc::driver::{DriverError, sys::CUresult};

/// A failure of the device or of compiling for it.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("no NVIDIA driver was found (libcuda.so); without a GPU, run on the CPU")]
    NoDriver,
    #[error("the NVIDIA driver finds no GPU it can use")]
    NoDevice,
    #[error("there is no GPU number {ordinal}: {count} can be seen, counted from 0")]
    NoSuchDevice { ordinal: usize, count: usize },
    #[error(
        "the NVIDIA driver supports CUDA {}.{} only, but NVRTC is of CUDA {}.{}; update the driver, or use an older NVRTC",
        driver.0, driver.1, nvrtc.0, nvrtc.1
    )]
    DriverTooOld { driver: (i32, i32), nvrtc: (i32, i32) },
    #[error(
        "{name} has compute capability {}.{}, and 8.0 is needed; run on the CPU",
        capability.0, capability.1
    )]
    GpuTooOld { name: String, capability: (i32, i32) },
    #[error(
        "NVRTC, the run-time compiler of CUDA, was not found (libnvrtc.so); install the CUDA toolkit or add its lib folder to LD_LIBRARY_PATH"
    )]
    NvrtcMissing,
    #[error("compiling {name} for {architecture} failed:\n{log}")]
    Compile { name: String, architecture: String, log: String },
    #[error(
        "not enough GPU memory: {} MiB are needed, {} MiB are available",
        needed.div_ceil(1 << 20), available >> 20
    )]
    OutOfMemory { needed: usize, available: usize },
    #[error(
        "a kernel accessed memory that is not its own; everything on the GPU since the last checkpoint is lost"
    )]
    IllegalAccess,
    #[error("CUDA: {0}")]
    Driver(String),
}

impl From<DriverError> for Error {
    fn from(error: DriverError) -> Self {
        match error.0 {
            CUresult::CUDA_ERROR_NO_DEVICE => Self::NoDevice,
            CUresult::CUDA_ERROR_ILLEGAL_ADDRESS | CUresult::CUDA_ERROR_MISALIGNED_ADDRESS => {
                Self::IllegalAccess
            }
            _ => Self::Driver(format!("{error}")),
        }
    }
}
