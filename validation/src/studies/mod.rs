//! Measurements, without the words that the report puts around them.

pub mod cell_crossings;
pub mod column_collapse;
pub mod element_tests;
pub mod fair_comparison;
pub mod grain_size;
pub mod model_choice;
pub mod pareto;
pub mod ranking;
pub mod recommendations;
pub mod rollouts;
pub mod solver_column;
pub mod stability;
pub mod stated_accuracy;
pub mod statistics;
pub mod sweep;
pub mod training_curves;
pub mod wall_times;
pub mod yade;
