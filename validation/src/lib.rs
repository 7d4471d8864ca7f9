//! The validation report: the solver and the learned simulators, measured and compared with theory,
//! experiments, another code and the paper.
//!
//! [`studies`] measure, [`render`] turns measurements into tables, charts and sentences, and
//! [`commands`] write the report. Runs are kept in a [`run_cache`], computed sections in a
//! [`section_cache`].

#![warn(missing_docs)]
#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod commands;
pub mod context;
pub mod difference;
pub mod folder;
pub mod library;
pub mod literature;
pub mod machine;
pub mod models;
pub mod program;
pub mod progress;
pub mod render;
pub mod run_cache;
pub mod scene_text;
pub mod section_cache;
pub mod studies;
pub mod suite;
pub mod text;
pub mod truth;
pub mod wall_time;
