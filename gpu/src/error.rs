//! Failures of the GPU, its driver or its compiler.

use cudarc::driver::{DriverError, sys::CUresult};

/// A failure of the device or of compiling for it.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The driver's library cannot be loaded.
    #[error("no NVIDIA driver was found (libcuda.so)")]
    NoDriver,
    /// The driver has no GPU.
    #[error("the NVIDIA driver finds no usable GPU")]
    NoDevice,
    /// There are fewer GPUs.
    #[error("there is no GPU {ordinal}: {count} are visible, counted from 0")]
    NoSuchDevice {
        /// Number of the GPU that was asked for, from 0.
        ordinal: usize,
        /// Number of GPUs.
        count: usize,
    },
    /// The driver cannot run what this NVRTC compiles.
    #[error(
        "the NVIDIA driver supports CUDA {}.{}, but NVRTC is of CUDA {}.{}; update the driver or use an older NVRTC",
        driver.0, driver.1, nvrtc.0, nvrtc.1
    )]
    DriverTooOld {
        /// Major and minor version of CUDA that the driver supports.
        driver: (i32, i32),
        /// Major and minor version of NVRTC.
        nvrtc: (i32, i32),
    },
    /// The GPU lacks instructions that the kernels need.
    #[error(
        "{name} has compute capability {}.{}, but 8.0 is needed",
        capability.0, capability.1
    )]
    GpuTooOld {
        /// The GPU's name.
        name: String,
        /// Major and minor compute capability.
        capability: (i32, i32),
    },
    /// NVRTC's library cannot be loaded.
    #[error(
        "NVRTC, CUDA's run-time compiler, was not found (libnvrtc.so); install the CUDA toolkit or add its lib folder to LD_LIBRARY_PATH"
    )]
    NvrtcMissing,
    /// A source does not compile.
    #[error("compiling {name} for {architecture} failed:\n{log}")]
    Compile {
        /// File name of the source.
        name: String,
        /// Such as `sm_80`.
        architecture: String,
        /// The compiler's messages.
        log: String,
    },
    /// An allocation does not fit.
    #[error(
        "not enough GPU memory: {} MiB are needed, {} MiB are free",
        needed.div_ceil(1 << 20), available >> 20
    )]
    OutOfMemory {
        /// Size of the allocation (bytes).
        needed: usize,
        /// Free memory (bytes).
        available: usize,
    },
    /// A kernel read or wrote beyond its arrays.
    #[error(
        "a kernel accessed memory outside of its arrays; all work on the GPU since the last checkpoint is lost"
    )]
    IllegalAccess,
    /// Any other error of the driver, in its words.
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
