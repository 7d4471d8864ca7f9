//! Element tests: one RVE driven along a path of strain rates and stresses.

mod packing_csv;
mod path_csv;
mod test_file;

pub use packing_csv::{packing_csv, read_packing};
pub(crate) use path_csv::PathColumns;
pub use path_csv::path_csv;
pub use test_file::{ElementTest, TestError};
