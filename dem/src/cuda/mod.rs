//! RVEs on an NVIDIA GPU: the CUDA twin of [`RveBatch`](crate::RveBatch).
//!
//! The kernel is CUDA C++ beside its wrapper (`rve.rs`): `rve.cu` and, step by step as on the CPU, the
//! `.cuh` files that it is put together from.
mod error;
mod list;
mod real;
mod rve;
mod shape;
mod state;

pub use error::{CudaError, RveFailure};
pub use real::CudaReal;
pub use rve::{CudaRveBatch, KernelResources, RVE_SOURCE};
pub use shape::{Room, Shape};
pub use state::State as DeviceState;
