//! The learned simulator: trajectories become graphs, a graph network (TGNNS or GNS) learns to
//! predict the accelerations of material points, and rollouts continue a flow frame by frame.
//!
//! - [`data`] cuts trajectories into windows and batches, [`features`] turns windows into graphs.
//! - [`network`] has the networks in Burn, [`inference`] and [`cuda`] compute them fast on the CPU
//!   and on a GPU.
//! - [`train`] trains, [`simulator`] is a trained network, [`rollout`] advances it.
//! - [`diagnostics`] tells how far a prediction can be trusted, [`evaluation`] measures its errors.
//! - [`workers`] share many rollouts out.
//! - [`commands`] are the commands of `surrogate`, [`program`] its command line. Nothing else prints.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use dempm::scene::Scene;
//! use surrogate::rollout::{InitialFrames, Rollout};
//! use surrogate::simulator::Simulator;
//!
//! # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
//! let simulator = Simulator::load(&root.join("models/tgnns-tiny.safetensors"))?;
//! let scene = Scene::load(root.join("scenes/column-mu-i.toml"))?;
//! let initial = InitialFrames::from_scene(scene, &simulator)?;
//! let mut rollout = Rollout::new(&simulator, &initial);
//! let positions = rollout.advance()?; // m
//! assert_eq!(positions.len(), initial.points.mass.len());
//! # Ok(())
//! # }
//! ```

#![warn(missing_docs)]
#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod commands;
pub mod cuda;
pub mod data;
pub mod diagnostics;
pub mod evaluation;
pub mod features;
pub mod inference;
pub mod network;
pub mod program;
pub mod rollout;
pub mod simulator;
pub mod train;
pub mod workers;
