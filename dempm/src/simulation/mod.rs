//! A scene in motion: material points, background grid and material, advanced step by step.
//!
//! [`Simulation`] owns a scene and its [`State`] and advances it on the CPU or, after
//! [`Simulation::move_to`], on a GPU. [`Simulation::header`] and [`Simulation::frame`] describe it
//! for a [trajectory](crate::trajectory).

pub mod cuda;
mod driver;
mod error;
mod frame_builder;
mod initial;
mod rve_material;
mod state;

pub use driver::Simulation;
pub use error::SimulationError;
pub use frame_builder::STABLE_STEP;
pub use rve_material::{RveMaterial, Tally};
pub use state::{SceneMaterial, State};
