//! From positions to the inputs of a network: radius graphs, node and edge features.

mod graph;
mod host_frame;
mod input;
mod node_features;
mod normalisation;
mod window;
mod window_features;

pub use graph::{RadiusGraph, radius_graph};
pub use host_frame::HostFrame;
pub use input::{FrameInput, Persistence, WindowInput};
pub use node_features::{MissingField, moving_features, overburden, standardised, static_features};
pub use normalisation::Normalisation;
pub use window::{Obstacle, Window, mirrored, mirrored_obstacle};
pub use window_features::{SKIN, host_frames, window_input};
