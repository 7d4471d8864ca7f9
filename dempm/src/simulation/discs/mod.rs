//! Every grain of a scene as a disc; points are means over the grains that started in their squares.

mod columns;
mod grid;
mod means;
mod members;
mod model;
mod running;

pub(super) use grid::grid_nodes;
pub use means::PointMeans;
pub use model::{DiscModel, DiscState};
