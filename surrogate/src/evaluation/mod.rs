//! Evaluation: rollouts compared with the trajectories that they should reproduce.

mod candidate;
mod compare;
mod error_samples;
mod metrics;
mod profile;
mod tables;
mod truth;
mod truth_table;

pub use candidate::candidate;
pub use compare::{Case, EvaluationError, compare, noise_floor};
pub use error_samples::error_sample;
pub use metrics::{Errors, FrameError, Measure, mean_square_distance};
pub use profile::overlaps;
pub use tables::{Summary, chart, frames_table, report, summaries, summary_table};
pub use truth::{AgainstTruth, Seeds, TruthError, TruthRow, against_truth, group_by_scene};
pub use truth_table::{truth_csv, truth_report};
