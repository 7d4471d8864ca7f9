//! Data sets: folders `train`, `valid` and `test` of trajectories from many scenes.
//!
//! [`cases`] lists the scenes of the paper or of a list file, [`scheduler`] runs them, several at a
//! time, [`report`] checks the results, and [`Metadata`] describes the training set.

mod case;
mod catalogue;
mod distribution;
mod error;
mod estimate;
mod keys;
mod list;
mod metadata;
mod paper;
mod random;
pub mod report;
pub mod scheduler;
mod selection;
mod split;
mod statistics;

pub use case::Case;
pub use catalogue::{cases, check_intervals, finished, refuse_existing, select};
pub use error::DatasetError;
pub use estimate::Estimate;
pub use metadata::Metadata;
pub(crate) use metadata::write_metadata;
pub use paper::paper_scene;
pub use selection::Selection;
pub use split::{DataSet, Split, open_finished};
pub use statistics::{Statistics, Welford};
