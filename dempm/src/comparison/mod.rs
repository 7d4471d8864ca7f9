//! What two runs of the same material have in common: times, and parts of the material.

mod parts;
mod squares;
mod times;

pub use parts::Parts;
pub use squares::{Square, Start, by_square, least_side, means, starts};
pub use times::common_frames;
