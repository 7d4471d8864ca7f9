//! From trajectory files to training batches.
//!
//! Files ([`Recording`]) -> windows of frames with the frame that follows ([`DataSet`]) -> shuffled
//! ([`Order`]), mirrored and noisy ([`Recipe`], [`Draft`]) -> normalised [`Batch`]es, made ahead of
//! time on another thread ([`Prefetch`]). A batch is a function of the seed and its number alone, so a
//! training resumes where it was without any state of the data.

mod batch;
mod draft;
mod error;
mod files;
mod mirror;
mod noise;
mod order;
mod prefetch;
mod statistics;
mod windows;

pub use batch::{Batch, Recipe, Shard};
pub use draft::{Draft, Unrolling};
pub use error::DataError;
pub use files::{DataFolder, Recording, trajectories_in};
pub use order::Order;
pub use prefetch::Prefetch;
pub use statistics::{Statistics, Welford, further_features};
pub use windows::{DataSet, Example, Shape};
