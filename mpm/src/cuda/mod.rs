//! The solver on an NVIDIA GPU: [`CudaSolver`] is the CUDA twin of [`Solver`](crate::Solver).
//!
//! Points and grid live in device memory in f64. Each step is a short row of kernels, named as the
//! algorithm's steps on the CPU; they depend on nothing that the host does between steps, so that
//! steps can be captured in a CUDA graph and replayed. There are no floating-point atomics: on one
//! device the result is the same bit by bit, and it differs from the CPU's by round-off.

mod error;
mod frame;
mod material;
mod memory;
mod solver;
mod source;
mod view;

pub use error::CudaError;
pub use material::{CudaDruckerPrager, CudaElastic, CudaMaterial};
pub use solver::{CudaSolver, Queue};
pub use source::{HEADER, SOURCE, defines};
pub use view::DeviceView;
