//! An NVIDIA GPU, found at run time, CUDA C++ compiled for it at first use, and several processes
//! with a GPU each.
//!
//! The same binary works on machines without a GPU, where [`Device::new`] says what is missing.
mod abi;
mod cache;
mod compiler;
mod device;
mod error;
mod launch;
pub mod ranks;

pub use abi::{ConstPointer, CudaDefinition, CudaName, CudaType, Pointer, define_struct};
pub use cache::cache_directory;
pub use compiler::{compile, nvrtc_is_present};
#[doc(hidden)]
pub use cudarc::driver::{DeviceRepr, ValidAsZeroBits};
pub use device::{Device, Limits, for_tests, nvrtc_for_tests};
pub use error::Error;
pub use launch::{CHECK_PARAMETERS, Function, Kernel, Launch, check_parameters};
