//! The networks on a GPU: forward, backward and optimiser as CUDA kernels of our own, in float32
//! or in bfloat16 with sums in float32. The plain Burn model of [`crate::model`] is the reference;
//! docs/benchmarks-gpu-surrogate.md has the design.
//!
//! States are rows of 128 columns; narrower networks are padded with zeros.

mod backward;
mod buffers;
mod error;
mod forward;
mod kernels;
mod layout;
mod network;
mod products;
mod profile;
mod rollout;
mod room;
mod trainer;
mod upload;

pub use buffers::{DeviceGraph, FrameInput};
pub use error::CudaError;
pub use kernels::{Precision, SOURCES, defines};
pub use network::{Capacity, CudaNetwork};
pub use trainer::{CudaTrainer, LOSSES, Rates};
pub use upload::{HostInput, upload};
