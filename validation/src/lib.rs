//! The validation report: what the solver and the learned simulators do, measured, beside what
//! theory, experiments and the paper say.

pub mod block;
pub mod chart;
pub mod command;
pub mod compare;
pub mod context;
pub mod figure;
pub mod html;
pub mod map;
pub mod model_cost;
pub mod pareto;
pub mod picture;
pub mod progress;
pub mod report;
pub mod rollouts;
pub mod scene;
pub mod section;
pub mod sections;
pub mod sweep;
pub mod table;
pub mod work;
