//! The learned simulator on an NVIDIA GPU.
//!
//! `ops` are the kernels: CUDA C++ beside typed wrappers of the same name (`graph.rs` and
//! `graph.cu`), each the twin of code for the CPU. The network, its training and rollouts are made of
//! them.
//!
//! Networks are computed in float32, or in bfloat16 with sums in float32. The plain Burn model of
//! [`crate::network`] is the reference; docs/notes/2026-11-22-network-kernels.md describes the design.
//! States are rows of 128 columns; narrower networks are padded with zeros.

mod activations;
mod advance;
mod ahead;
mod backward_pass;
mod batch;
mod error;
mod forward_pass;
mod frame_builder;
mod graph_builder;
mod integrator;
mod layout;
mod member;
mod network;
mod ops;
mod products;
mod pushforward;
mod rollout_graph;
mod rollout_thread;
mod support;
mod trainer;
mod upload;
mod weight_gradient;

pub use gpu::Source;

pub use ahead::compile_ahead;
pub use batch::{BatchBuilder, DeviceBatch, EDGES_PER_POINT, HostWindows, PredictionInput};
pub use error::CudaError;
pub use frame_builder::{FrameBuilder, NewFrame};
pub use graph_builder::GraphBuilder;
pub use integrator::{BLOCK, Frames, Integrator, Landing, Motion};
pub use member::Start;
pub use network::CudaNetwork;
pub use ops::features::features_source;
pub use ops::frame_input::{DeviceGraph, FrameInput};
pub use ops::graph::graph_source;
pub use ops::integrate::integrate_source;
pub use ops::kernels::network_sources;
pub use ops::push_forward::push_forward_source;
pub use rollout_graph::{CudaRollout, Network};
pub use rollout_thread::PredictedFrames;
pub use support::{Capacity, supports};
pub use trainer::{CudaTrainer, LOSSES, Rates, Targets};
pub use upload::{HostInput, upload};
