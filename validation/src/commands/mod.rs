//! The commands: arguments, terminal output and exit codes.

pub mod compare;
mod differences;
mod distances;
pub mod fit;
pub mod library;
pub mod page;
pub mod report;
pub mod suite;
