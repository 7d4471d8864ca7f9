//! The table of measured cases that `dempm choose` predicts errors from: every candidate on many scenes, each against
//! several seeds of discs.

mod measure;
mod scenes;

pub use measure::measure;
pub use scenes::{Named, Options, read, run};
