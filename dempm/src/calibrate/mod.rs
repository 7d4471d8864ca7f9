//! Calibration: grains that behave like a measured material.
//!
//! Element tests and columns of a laboratory are [targets](Targets). An [`ensemble`] of sets of free parameters
//! is simulated side by side, several packings each, and moved towards the targets by ensemble Kalman inversion. A
//! quadratic [`emulator`] of all these simulations then gives the [posterior](Posterior).

mod column;
mod curve;
pub mod emulator;
pub mod ensemble;
mod error;
mod experiment;
pub mod law;
mod page;
mod parameter;
mod posterior;
mod quantity;
mod results;
mod study;
mod targets;

pub use column::ColumnTest;
pub use error::CalibrationError;
pub use experiment::{Experiment, Observation, simulate};
pub use page::page;
pub use parameter::{Free, Prior};
pub use posterior::{Determined, Posterior};
pub use results::{calibrated_toml, members_csv, summary_toml};
pub use study::{Member, Progress, Study};
pub use targets::{Method, Targets};
