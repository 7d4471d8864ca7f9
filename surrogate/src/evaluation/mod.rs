//! Evaluation: rollouts compared with the trajectories that they should reproduce.

mod compare;
mod metrics;
mod tables;

pub use compare::{Case, EvaluationError, compare, noise_floor};
pub use metrics::{Errors, FrameError, mean_square_distance};
pub use tables::{chart, frames_table, report, summary_table};
