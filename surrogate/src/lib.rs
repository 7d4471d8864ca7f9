//! The learned simulator: trajectories become graphs, a graph network (TGNNS or GNS) learns to
//! predict the accelerations of material points, and rollouts continue a flow frame by frame.
//!
//! - [`data`] cuts trajectories into windows and batches, [`features`] turns windows into graphs.
//! - [`network`] has the networks in Burn, [`inference`] and [`cuda`] compute them fast on the CPU
//!   and on a GPU.
//! - [`train`] trains, [`simulator`] is a trained network, [`rollout`] advances it.
//! - [`diagnostics`] tells how far a prediction can be trusted, [`evaluation`] measures its errors.
//! - [`commands`] are the commands of `surrogate`. Nothing else prints.

pub mod chart;
pub mod commands;
pub mod cuda;
pub mod data;
pub mod diagnostics;
pub mod evaluation;
pub mod features;
pub mod inference;
pub mod network;
pub mod rollout;
pub mod simulator;
pub mod train;
