//! Checks that tell how far a prediction can be trusted: before a rollout, during it and in every
//! frame.

mod accuracy;
mod asymmetry;
mod crowding;
mod error_features;
mod error_model;
mod monitor;
mod regression;
mod start_checks;
mod training_range;

pub use accuracy::Accuracy;
pub use asymmetry::{MirrorDifference, asymmetry, mirror_difference, mirror_image};
pub use crowding::CrowdingLimit;
pub use error_features::ErrorFeatures;
pub use error_model::{
    COVERED, ErrorModel, ErrorSample, ExpectedError, FEATURES, Features, LEAST_SCENES, PARTS,
};
pub use monitor::Monitor;
pub use start_checks::start_checks;
pub use training_range::{FlowState, TrainingRange};
