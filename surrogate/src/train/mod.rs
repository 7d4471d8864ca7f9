//! Training: data, optimiser, backends, checkpoints and validation.

mod all_reduce;
mod backend;
mod burn;
mod checkpoint;
mod config;
mod config_error;
mod config_file;
mod cuda;
mod error;
mod folder;
mod input;
mod log;
mod observer;
mod optimiser;
mod pretrained;
#[cfg(test)]
mod rank_tests;
mod ranks;
#[cfg(all(test, feature = "burn-cuda"))]
mod reference_tests;
mod schedule;
mod session;
mod state;
mod tcp;
mod training_loop;

pub use checkpoint::CheckpointError;
pub use config::{Data, LossOver, Optimiser, Pushforward, TrainConfig, Validation};
pub use config_error::ConfigError;
pub use error::TrainError;
pub use folder::{check_new, checkpoint_in};
pub use log::LogError;
pub use observer::TrainObserver;
pub use schedule::{Decay, Schedule};
pub use session::{Session, SessionOptions, Summary};
pub use training_loop::{Outcome, Report, WARM_UP_STEPS};
