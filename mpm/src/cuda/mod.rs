//! The solver on an NVIDIA GPU: [`CudaSolver`] is the CUDA twin of [`Solver`](crate::Solver).
//!
//! Points and grid live in device memory in f64. Each step is a short row of kernels, named as the
//! algorithm's steps on the CPU; they depend on nothing that the host does between steps, so that
//! steps can be captured in a CUDA graph and replayed. There are no floating-point atomics: on one
//! device the result is the same bit by bit, and it differs from the CPU's by round-off.

mod abi;
mod bins;
mod budget;
mod cell_average;
mod density;
mod drucker_prager;
mod elastic;
mod error;
mod frame;
mod g2p;
mod kernels;
mod ledger;
mod material;
mod memory;
mod obstacle;
mod p2g;
mod queue;
mod solver;
mod source;
mod velocity_gradient;

pub use abi::{
    Approach, Bins, Clock, Fault, Matrix, Mpm, Obstacle, Phase, Placed, Stencil, Vector,
};
pub use error::CudaError;
pub use material::{CudaDruckerPrager, CudaElastic, CudaMaterial};
pub use queue::Queue;
pub use solver::CudaSolver;
pub use source::{defines, header, source};
