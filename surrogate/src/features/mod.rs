//! From positions to the inputs of a network: radius graphs, node and edge features.

mod graph;
mod host_frame;
mod input;
mod material;
mod node_features;
mod normalisation;
mod obstacle;
mod surfaces;
mod window;
mod window_features;

pub use graph::{RadiusGraph, radius_graph};
pub use host_frame::HostFrame;
pub use input::{FrameInput, Persistence, WindowInput};
pub use material::{MATERIAL_COLUMNS, material};
pub use node_features::{MissingField, moving_features, overburden, standardised, static_features};
pub use normalisation::Normalisation;
pub use obstacle::{Obstacle, friction_coefficient};
pub use surfaces::{SURFACE_COLUMNS, SURFACE_VELOCITY, surfaces};
pub use window::{Window, mirrored};
pub use window_features::{SKIN, host_frames, window_input};
