//! The commands: arguments, terminal output and exit codes. All else is in the other modules, which
//! know nothing of the terminal.

pub mod bench;
pub mod calibrate;
pub mod check;
pub mod choose;
pub mod dataset;
mod device;
pub mod element;
pub mod export;
pub mod import;
pub mod info;
mod learned;
mod outputs;
pub mod plot;
mod progress;
pub mod run;
pub mod shell_files;
mod start;
mod summary;
pub mod terminal;
