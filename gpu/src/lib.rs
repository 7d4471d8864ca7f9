//! NVIDIA GPUs: found at run time, with kernels in CUDA C++ that are compiled at first use.
//!
//! The same binary works on machines without a GPU, where [`Device::new`] returns what is missing.
//!
//! - [`Device`]: a GPU, its stream and its memory.
//! - [`cuda_struct!`], [`kernel!`]: structs and kernel arguments, defined once for Rust and CUDA C++.
//! - [`Function`]: a kernel, and how it is launched.
//! - [`ranks`]: several processes with a GPU each.

#![warn(missing_docs)]

mod abi;
mod ahead;
mod cache;
mod compiler;
mod device;
mod error;
mod launch;
mod pointer;
pub mod ranks;
mod source;

pub use abi::{CudaDefinition, CudaName, CudaType, define_struct};
pub use cache::cache_directory;
pub use compiler::{compile, nvrtc_is_present};
#[doc(hidden)]
pub use cudarc::driver::{DeviceRepr, ValidAsZeroBits};
pub use device::{Device, Limits, for_tests, nvrtc_for_tests};
pub use error::Error;
pub use launch::{CHECK_PARAMETERS, Function, Kernel, Launch, check_parameters};
pub use pointer::{ConstPointer, Pointer};
pub use source::Source;
