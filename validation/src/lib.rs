//! The validation report: what the solver and the learned simulators do, measured, beside what
//! theory, experiments and the paper say.

pub mod animation;
pub mod block;
pub mod command;
pub mod compare;
pub mod compare_files;
pub mod computed;
pub mod context;
pub mod figure;
pub mod html;
pub mod machine;
pub mod map;
pub mod model_cost;
pub mod pareto;
pub mod picture;
pub mod progress;
pub mod report;
pub mod results;
pub mod rollouts;
pub mod scene;
pub mod section;
pub mod sections;
pub mod sweep;
pub mod table;
pub mod wall_time;
pub mod work;
