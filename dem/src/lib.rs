//! Periodic two-dimensional DEM packings as representative volume elements (RVEs).
//!
//! Compression is positive in this crate.
mod batch;
pub mod cell;
mod contact;
pub mod cuda;
mod disc;
pub mod element;
mod error;
mod homogenise;
mod integrate;
mod neighbours;
mod packing;
mod parameters;
mod prepare;
mod real;
mod rve;

pub use batch::RveBatch;
pub use cell::Cell;
pub use contact::{ContactLaw, ContactSums, Force, Forces, contact_forces};
pub use disc::{Disc, PlainDisc};
pub use error::{Error, Failure};
pub use homogenise::{inertial_number, stress};
pub use neighbours::Pair;
pub use packing::{Contact, Packing};
pub use parameters::{Preparation, RveParameters};
pub use prepare::{Prepared, Rung, consolidate, ladder, prepare};
pub use real::Real;
pub use rve::{Rve, RveState, Substepping};
