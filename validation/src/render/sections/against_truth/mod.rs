//! Models against the truth: the same scenes with every grain as a disc.

mod charts;
mod grain_size;
mod list;
mod overview;
mod scene;
mod tables;

pub use list::all;
pub use scene::truth_blocks;
