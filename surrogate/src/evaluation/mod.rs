//! Evaluation: rollouts compared with the trajectories that they should reproduce.

mod candidate;
mod compare;
mod error;
mod error_samples;
mod metrics;
mod profile;
mod seeds;
mod tables;
mod truth;
mod truth_table;

pub use candidate::candidate;
pub use compare::{Case, compare, noise_floor};
pub use error::EvaluationError;
pub use error_samples::error_sample;
pub use metrics::{Errors, FrameError, Measure, mean_square_distance};
pub use profile::overlaps;
pub use seeds::{Seeds, group_by_scene};
pub use tables::{Summary, chart, frames_table, report, summaries, summary_table};
pub use truth::{AgainstTruth, TruthRow, against_truth, check_others};
pub use truth_table::{truth_csv, truth_report};
