//! Whole scenes of discs against closed forms and against themselves.

mod boundaries;
mod budget;
mod column;
mod common;
mod errors;
mod invariance;
mod lists;
mod pair;
mod restart;
mod rolling;
mod silo;
mod sleep;
mod stack;
