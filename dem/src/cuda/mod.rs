//! RVEs on an NVIDIA GPU: the CUDA twin of [`RveBatch`](crate::RveBatch).
//!
//! The kernel is CUDA C++ beside its wrapper (`rve.rs` and `rve.cu`).
mod error;
mod list;
mod real;
mod rve;
mod shape;
mod state;

pub use error::{CudaError, RveFailure};
pub use real::CudaReal;
pub use rve::{CudaRveBatch, KernelResources, RVE_SOURCE};
pub use shape::Shape;
pub use state::State as DeviceState;
