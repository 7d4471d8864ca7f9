//! From trajectory files to training batches.
//!
//! Trajectory files ([`Recording`]) are cut into windows of frames with the frame that follows
//! ([`DataSet`]), shuffled ([`Sampler`]), mirrored and disturbed by noise ([`Recipe`],
//! [`Examples`]), and normalised to [`Batch`]es on other threads ahead of time ([`Prefetch`]). A
//! batch is a function of the seed and its number alone, so an interrupted training resumes
//! without any state of the data.

mod batch;
mod emphasis;
mod error;
mod files;
mod mirror;
mod noise;
mod prefetch;
mod pushforward;
mod sampler;
mod statistics;
mod windows;

pub use batch::{Batch, Recipe, Shard};
pub use error::DataError;
pub use files::{DataFolder, Recording, extrapolate, trajectories_in};
pub use prefetch::Prefetch;
pub use pushforward::{Examples, Unrolling};
pub use sampler::Sampler;
pub use statistics::{Statistics, Welford, further_features};
pub use windows::{DataSet, Example, WindowShape};
