//! Validation of the direct solver and the learned simulator.
pub mod stability;
