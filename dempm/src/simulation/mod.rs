//! A scene in motion: points and the model that moves them, advanced step by step.
//!
//! [`Simulation`] owns a scene, its points and its [`Model`], and advances them on the CPU or, after
//! [`Simulation::move_to`], on a GPU. [`Simulation::header`] and [`Simulation::frame`] describe it
//! for a [trajectory](crate::trajectory).

pub mod cuda;
mod discs;
mod driver;
mod error;
mod frame_builder;
mod initial;
mod model;
mod mpm_model;
mod rve_material;
mod scene_material;
mod span;
mod state;

pub use discs::{DiscModel, DiscState, PointMeans};
pub use driver::Simulation;
pub use error::SimulationError;
pub use model::Model;
pub use mpm_model::{MpmModel, MpmState, STABLE_STEP};
pub use rve_material::{RveMaterial, Tally};
pub use scene_material::SceneMaterial;
pub use state::{ModelState, State};
