//! The commands of `surrogate`: arguments, terminal output and exit codes.

mod calibrate_error;
mod eval;
mod expect;
mod prediction;
mod progress;
mod rollout;
mod rollout_group;
mod rollout_many;
mod stats;
mod train;

pub use calibrate_error::{CalibrateErrorArgs, calibrate_error};
pub use eval::{EvalArgs, eval};
pub use expect::{ExpectArgs, expect, expect_of};
pub use rollout::{RolloutArgs, rollout};
pub use stats::{StatsArgs, stats};
pub use train::{TrainArgs, train};
