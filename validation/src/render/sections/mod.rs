//! The sections of the report.
//!
//! A new one is a file here that implements [`Section`](crate::render::section::Section), usually with
//! a measurement in [`studies`](crate::studies), and a line in the list of chapters.

mod against_truth;
mod chapters;
mod column_collapse;
mod column_rollouts;
mod cover;
mod element_tests;
mod fair_comparison;
mod model_choice;
mod no_model;
mod paper;
mod recommendations;
mod runs;
mod speed_accuracy;
mod stability;
mod yade;

pub use against_truth::truth_blocks;
pub use chapters::{all, chapter_about, section_lead};
