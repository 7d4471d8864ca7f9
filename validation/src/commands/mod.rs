//! The commands: arguments, terminal output and exit codes.

pub mod compare;
pub mod page;
pub mod report;
pub mod suite;
