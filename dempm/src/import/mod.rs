//! Trajectories of other learned simulators in the format of this suite.

mod bodies;
mod error;
mod foreign;
mod gns;
mod lagrangebench;
mod metadata;
mod number;
mod pickle;
mod scene_text;
mod write;

pub use error::ImportError;
pub use pickle::PickleError;
pub use write::{Format, Imported, import};
