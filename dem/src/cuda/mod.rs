//! RVEs on an NVIDIA GPU: the CUDA twin of [`RveBatch`](crate::RveBatch).
//!
//! The kernel is CUDA C++ beside its wrapper (`rve.rs`): `rve.cu` and, step by step as on the CPU, the
//! `.cuh` files that it is put together from.

mod abi;
mod arrays;
mod batch;
mod error;
mod list;
mod real;
mod rve;
mod shape;

pub use abi::{State, Tensor};
pub use batch::{CudaRveBatch, KernelResources};
pub use error::{CudaError, RveFailure};
pub use real::CudaReal;
pub use rve::source;
pub use shape::{Room, Shape};
