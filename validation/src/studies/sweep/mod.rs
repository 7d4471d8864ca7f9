//! One scene with many methods and settings: what each costs and how far off it is.

mod cases;
mod measured;
mod run;

pub use cases::Case;
pub use measured::{Error, Family, MEASURES, Measure, Measured, Sweep};
