//! Rollouts: the network predicts a frame, sees it, and predicts the next one.
//!
//! [`InitialFrames`] are simulated or read from a trajectory, [`Rollout`] advances them frame by
//! frame within the [`Constraints`] of the scene, and [`record`] writes them to a trajectory file.

mod constraints;
mod engine;
mod error;
mod frames;
mod initial_frames;
mod lattice_start;
mod recorder;
mod scene_of_training;

pub use constraints::Constraints;
pub use engine::Rollout;
pub use error::RolloutError;
pub use frames::FrameBuilder;
pub use initial_frames::{InitialFrames, InitialFramesError, static_features_of, stride};
pub use recorder::{RecordedRollout, Recording, RecordingOptions, RolloutObserver, record};
pub(crate) use scene_of_training::discs_on_grid_of_training;
