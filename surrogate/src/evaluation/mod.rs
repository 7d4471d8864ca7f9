//! Evaluation: rollouts compared with the trajectories that they should reproduce.

mod compare;
mod metrics;
mod profile;
mod tables;

pub use compare::{Case, EvaluationError, compare, noise_floor};
pub use metrics::{Errors, FrameError, Measure, mean_square_distance};
pub use profile::overlaps;
pub use tables::{Summary, chart, frames_table, report, summaries, summary_table};
