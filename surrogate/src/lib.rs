//! The learned simulator: trajectories -> graphs -> TGNNS -> training and rollout.

pub mod accuracy;
pub mod asymmetry;
pub mod backend;
pub mod chart;
pub mod config;
pub mod constraints;
pub mod cuda;
pub mod data;
pub mod doubts;
pub mod eval;
pub mod features;
pub mod graph;
pub mod inference;
pub mod metrics;
pub mod model;
pub mod node_features;
pub mod precision;
pub mod pressed;
pub mod range;
pub mod rollout;
pub mod simulator;
pub mod start;
pub mod stats;
pub mod train;
pub mod watch;
pub mod weights;
