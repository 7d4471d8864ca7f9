//! The commands of `surrogate`: arguments, terminal output and exit codes.

mod eval;
mod progress;
mod rollout;
mod stats;
mod train;

pub use eval::{EvalArgs, eval};
pub use rollout::{RolloutArgs, rollout};
pub use stats::{StatsArgs, stats};
pub use train::{TrainArgs, train};
