//! Kernels: CUDA C++ and typed wrappers.

pub mod backward;
pub mod constraints;
pub mod edges_backward;
pub mod features;
pub mod forward;
pub mod frame_input;
mod geometry;
pub mod gradient;
pub mod graph;
pub mod integrate;
pub mod kernels;
pub mod launcher;
pub mod muon;
pub mod optimiser;
mod profile;
pub mod push_forward;
mod resident_or_streamed;
pub mod segment;
pub mod tile;
pub mod weights;
