//! Calibration: grains that behave like a measured material.
//!
//! Element tests and columns of a laboratory are [targets](Targets). An [`ensemble`] of sets of free parameters
//! is simulated side by side, several packings each, in a [laboratory](Laboratory), and moved towards the targets by
//! ensemble Kalman inversion. A quadratic [`emulator`] of all these simulations then gives the [posterior](Posterior).

mod column;
mod curve;
pub mod emulator;
pub mod ensemble;
mod error;
mod experiment;
mod laboratory;
pub mod law;
mod likelihood;
mod line;
mod page;
mod parameter;
mod posterior;
mod quantity;
mod results;
mod sampler;
mod study;
mod targets;

pub use column::ColumnTest;
pub use error::CalibrationError;
pub use experiment::{Experiment, Observation, Specimen};
pub use laboratory::{Laboratory, Progress};
pub use page::page;
pub use parameter::{Free, Prior};
pub use posterior::{Determined, Posterior};
pub use results::{calibrated_toml, members_csv, summary_toml};
pub use study::{Member, Predictions, Simulator, Study};
pub use targets::{Method, Targets};
