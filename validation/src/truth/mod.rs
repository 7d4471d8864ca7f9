//! How far a model is from the truth: the same scene with every grain as a disc.
//!
//! A truth is a set of such runs, which differ in their seeds. Chaos separates them, so the distance
//! between two of them is the smallest that a model can be held to. Both distances are root mean
//! squares between squares of material: the mean of what started in the same square.

mod arrest;
mod comparison;
mod fronts;
mod misplaced;
mod motion;
mod pairs;
mod reference;
mod row;

pub use arrest::arrest;
pub use comparison::{Comparison, compare};
pub use misplaced::{Shares, misplaced};
pub use motion::{Motion, State};
pub use reference::Reference;
pub use row::{Row, Seeds};
