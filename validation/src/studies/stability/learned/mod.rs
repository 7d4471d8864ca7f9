//! The learned simulators, beyond what they were trained on.

pub mod at_rest;
pub mod perturbed;
mod rollout;
pub mod rollout_length;
pub mod training_range;
pub mod walls;

pub use rollout::{load, window};
