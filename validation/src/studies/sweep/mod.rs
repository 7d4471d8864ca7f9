//! One scene with many methods and settings: what each costs and how far it is from the truth.

mod cases;
mod measured;
mod run;
mod scenes;

pub use cases::Case;
pub use measured::{Error, Family, MEASURES, Measure, Measured, Sweep};
pub use scenes::{Kind, TruthScene};
