//! Whole scenes on an NVIDIA GPU: the CUDA twin of [`Assembly`](crate::assembly::Assembly).
//!
//! Every step is one kernel, one thread a disc (`step.cu`). Sixteen steps and the decision on a search
//! (`search.cu`) are one CUDA graph, which the host launches until the steps are done: steps that find the
//! lists outdated do nothing. On several GPUs every rank advances a vertical slab (`shared.rs`).

mod abi;
mod energy;
mod error;
mod exchange;
mod grid;
mod kernels;
mod losses;
mod means;
mod output;
mod parameters;
mod points;
mod rounds;
mod search;
mod shared;
mod slabs;
mod sleep;
mod solver;
mod sort;
mod state;
mod step;
mod summary;
mod transfer;

pub use error::CudaAssemblyError;
pub use kernels::{defines, kernels_of, source};
pub use state::CudaAssembly;
