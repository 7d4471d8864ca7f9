//! Periodic two-dimensional packings of discs as representative volume elements (RVEs), by the discrete
//! element method (DEM; Cundall & Strack 1979, Géotechnique 29, 47).
//!
//! A packing deforms with its cell under a velocity gradient and returns its homogenised stress.
//! Compression is positive, units are SI.
//!
//! ```
//! use dem::{Forces, Rve, RveParameters, Substepping, consolidate};
//! use nalgebra::Matrix2;
//!
//! let p = RveParameters { discs: 30, ..RveParameters::default() };
//! let packing = consolidate(&p, 1)?;
//! let mut rve = Rve::new(packing.clone());
//! // Simple shear at 1 / s, in macro steps of 1e-4 s.
//! let velocity_gradient = Matrix2::new(0.0, 1.0, 0.0, 0.0);
//! let substepping = Substepping::new(&p, 1.0e-4);
//! let mut forces = Forces::default();
//! for _ in 0..10 {
//!     let state = rve.advance(&velocity_gradient, &p, &substepping, &packing, &mut forces)?;
//!     assert!(state.stress.trace() > 0.0);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

pub mod assembly;
mod batch;
pub mod cell;
mod contact;
pub mod cuda;
mod disc;
pub mod element;
mod error;
mod grains;
mod homogenise;
mod integrate;
mod neighbours;
mod packing;
mod parameters;
mod prepare;
mod real;
mod rve;
mod state;

pub use batch::RveBatch;
pub use cell::Cell;
pub use contact::{ContactLaw, ContactSums, Force, Forces, contact_forces};
pub use disc::{Disc, PlainDisc};
pub use error::{Error, Failure};
pub use grains::Grains;
pub use homogenise::{inertial_number, stress};
pub use neighbours::Pair;
pub use packing::{Contact, Packing};
pub use parameters::{Preparation, RveParameters};
pub use prepare::{Rung, consolidate, ladder};
pub use real::Real;
pub use rve::{Rve, Substepping};
pub use state::RveState;
