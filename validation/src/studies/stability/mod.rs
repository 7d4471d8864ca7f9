//! Each method pushed until it fails: one study for each file.
//!
//! A [`Study`] is plain data: what was tested, what counts as failure, the thresholds, measured and by
//! theory, and the program's messages.

pub mod dem_dilute;
pub mod dem_overlap;
pub mod dem_precision;
pub mod dem_shear;
pub mod dem_size;
pub mod dem_step;
pub mod dem_thin;
pub mod learned;
pub mod mpm_crossing;
pub mod mpm_step;
pub mod mpm_transfer;
mod outcome;
mod packing;
mod scene_messages;
mod study;
pub mod tall_columns;
mod threshold;

pub use outcome::Outcome;
pub use study::{Axis, Chart, Curve, Finding, Map, Picture, Study, StudyError};
pub use threshold::Threshold;
