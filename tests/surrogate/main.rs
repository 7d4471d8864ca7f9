//! `surrogate` as a user meets it: trajectories -> training -> rollout -> evaluation.

mod doubts;
mod errors;
mod helpers;
mod ranks;
mod rollouts;
mod training;
