//! The learned simulator on an NVIDIA GPU. Kernels are CUDA C++ beside their wrappers (`graph.rs`
//! and `graph.cu`), and each is the twin of code for the CPU.
//!
//! The networks are computed in float32, or in bfloat16 with sums in float32. The plain Burn model
//! of [`crate::network`] is the reference; docs/notes/2026-11-22-network-kernels.md has the design. States are
//! rows of 128 columns; narrower networks are padded with zeros.

mod ahead;
mod arguments;
mod backward;
mod batch;
mod buffers;
mod constraints;
mod error;
mod features;
mod forward;
mod graph;
mod integrate;
mod kernels;
mod launch;
mod layout;
mod network;
mod predict;
mod products;
mod profile;
mod push_forward;
mod rollout;
mod room;
mod trainer;
mod upload;

pub use ahead::Ahead;
pub use batch::{BatchBuilder, DeviceBatch, EDGES_PER_POINT, HostWindows, Seen};
pub use buffers::{DeviceGraph, FrameInput};
pub use error::CudaError;
pub use features::{FEATURES_SOURCE, FrameBuilder, NewFrame, features_defines};
pub use graph::{GRAPH_SOURCE, GraphBuilder, graph_defines};
pub use integrate::{BLOCK, Frames, INTEGRATE_SOURCE, Integrator, Landing, Motion};
pub use kernels::{SOURCES, defines};
pub use network::{Capacity, CudaNetwork, supports};
pub use predict::{CudaRollout, Network, Past};
pub use push_forward::PUSH_FORWARD_SOURCE;
pub use trainer::{CudaTrainer, LOSSES, Rates};
pub use upload::{HostInput, upload};
