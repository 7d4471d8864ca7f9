//! Stability: every method is pushed until it fails.
//!
//! One study per file: what is pushed, what counts as failure, the threshold measured and by theory,
//! and what the program said. Studies give plain data ([`Study`]).

pub mod dem_step;
pub mod mpm_step;
pub mod outcome;
mod packing;
mod scene;
pub mod study;
pub mod threshold;

pub use outcome::{Kind, Outcome};
pub use study::{Axis, Chart, Curve, Finding, Map, Picture, Size, Study, StudyError};
pub use threshold::Threshold;
