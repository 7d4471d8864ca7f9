//! A simulation on an NVIDIA GPU. Points, grid and packings stay in device memory from frame to
//! frame, and macro steps are replayed as a CUDA graph, without work of the host in between.

mod material;
mod ranked_batch;
mod replay;
mod rve_material;
mod timer;

pub(crate) use replay::CudaSimulation;
pub use rve_material::{defines, source};
