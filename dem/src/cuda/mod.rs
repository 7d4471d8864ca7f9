//! Packings and whole scenes on an NVIDIA GPU: the CUDA twins of [`RveBatch`](crate::RveBatch) and
//! [`Assembly`](crate::assembly::Assembly).
//!
//! The kernel of packings is CUDA C++ beside its wrapper (`rve.rs`): `rve.cu` and, step by step as on the CPU, the
//! `.cuh` files that it is put together from.

mod abi;
mod arrays;
mod assembly;
mod batch;
mod elements;
mod error;
mod list;
mod real;
mod rve;
mod shape;

pub use abi::{State, Tensor};
pub use assembly::{
    CudaAssembly, CudaAssemblyError, defines as assembly_defines, kernels_of as assembly_kernels,
    source as assembly_source,
};
pub use batch::{CudaRveBatch, KernelResources};
pub use elements::{ElementTest, consolidate_all, run_stages};
pub use error::{CudaError, RveFailure};
pub use real::CudaReal;
pub use rve::source;
pub use shape::{Room, Shape};
