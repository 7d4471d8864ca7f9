//! `surrogate` as a user meets it: trajectories -> training -> rollout -> evaluation.

mod errors;
mod expected_error;
mod helpers;
#[path = "../common/port.rs"]
mod port;
mod ranks;
mod rollouts;
mod start_checks;
mod training;
mod truth;
