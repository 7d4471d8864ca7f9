//! Trajectories and data sets in the formats of other programs.

mod error;
mod finite;
mod gns;
mod lagrangebench;
mod metadata;
mod npy;
mod npz;
mod outlines;
mod particles;
mod rigid;
mod split_files;
mod vtkhdf;
mod vtp;

pub use error::ExportError;
pub use npz::write as write_npz;
pub use split_files::{Format, Written, write as write_data_set};
pub use vtkhdf::write as write_vtkhdf;
pub use vtp::write as write_vtk;
