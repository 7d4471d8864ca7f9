//! The trajectory file: all results of a run in one HDF5 file.
//!
//! A trajectory is written by [`TrajectoryWriter`] and read by [`Trajectory`]; `docs/formats.md`
//! lists its datasets and attributes. At any moment, even after `kill -9`, the file is complete
//! and readable and holds whole frames only, and a resumed run continues it as if it had never stopped.

mod attributes;
mod checked_file;
mod chunk;
mod error;
mod frame;
mod grain_datasets;
mod grains;
mod grid;
mod grid_datasets;
mod header;
mod header_limits;
mod layout;
mod links;
mod meaning;
mod opening;
mod reader;
mod storage;
mod texts;
mod vtk;
pub(crate) mod vtk_layout;
mod write_through;
mod writer;

pub use error::{Result, TrajectoryError};
pub use frame::{Frame, Points};
pub use grains::{GrainFrame, StaticGrains};
pub use grid::{GridFrame, StaticGrid};
pub use header::Header;
pub use layout::{FORMAT, FORMAT_VERSION, Field};
pub(crate) use links::new_group;
pub(crate) use opening::open_hdf5;
pub use reader::Trajectory;
pub(crate) use write_through::{WriteThrough, system_error};
pub use writer::TrajectoryWriter;
