//! Whole scenes: every disc between walls, boxes and a floor, by the discrete element method
//! (Cundall & Strack 1979, Géotechnique 29, 47).
//!
//! Grains and their contact law are those of the periodic packings. [`prepare_column`] fills a column with
//! grains at rest; [`Assembly`] advances them.

mod bodies;
mod boundary;
mod coarse_grain;
mod contacts;
mod conversion;
mod coordinates;
mod energy;
mod error;
mod failure;
mod listing;
mod members;
mod memory;
mod motion;
mod output;
mod packed;
mod pairs;
mod point_mean;
mod prepare;
mod profile;
mod resting;
mod search;
mod settling;
mod sleep;
mod solver;
mod state;
mod step;
mod tile;
mod touching;

pub use boundary::{Boundary, Faces, Floor, RigidBox};
pub use coarse_grain::{CoarseGraining, Continuum};
pub use energy::{Energy, Losses};
pub use error::{AssemblyError, GrainFailure};
pub use members::Members;
pub use packed::{Grain, GrainState, Packed, PackedContact, Partner};
pub use point_mean::{PointMean, Surroundings, point_means};
pub use prepare::{ColumnBox, prepare_column};
pub use profile::{Layer, profile};
pub use settling::{Settling, Start, on_cpu};
pub use sleep::Sleep;
pub use state::Assembly;

pub(crate) use coordinates::Region;
pub(crate) use memory::ContactMemory;
pub(crate) use pairs::{History, Rolling, Sliding};
pub(crate) use point_mean::SAMPLES;
pub(crate) use sleep::{Rest, State};
