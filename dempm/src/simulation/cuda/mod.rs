//! A simulation on an NVIDIA GPU. Points, grid and packings stay in device memory between frames, and
//! macro steps are replayed as CUDA graphs without the host.

mod ahead;
mod material;
mod ranked_batch;
mod replay;
mod rve_material;
mod timer;

pub(crate) use ahead::compile_ahead;
pub(crate) use replay::CudaSimulation;
pub use rve_material::{defines, source};
