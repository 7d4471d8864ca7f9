//! The learned simulator on an NVIDIA GPU. Kernels are CUDA C++ beside their wrappers (`graph.rs`
//! and `graph.cu`), and each is the twin of code for the CPU.

mod ahead;
mod batch;
mod buffers;
mod constraints;
mod error;
mod features;
mod graph;
mod integrate;
mod launch;
mod noise;
mod predict;

pub use ahead::Ahead;
pub use batch::{BatchBuilder, DeviceBatch};
pub use buffers::{DeviceGraph, FrameInput};
pub use error::CudaError;
pub use features::{FEATURES_SOURCE, FrameBuilder, features_defines};
pub use graph::{GRAPH_SOURCE, GraphBuilder, graph_defines};
pub use integrate::{BLOCK, Frames, INTEGRATE_SOURCE, Integrator, Landing, Motion};
pub use noise::{Augmentation, Member, NOISE_SOURCE, make_windows_on_cpu};
pub use predict::{CudaRollout, Network};
