//! The wall time that a method is judged by.

use dempm::trajectory::Trajectory;

/// Wall time of the computation, s: all phases but the preparation of packings, which is done once
/// and kept.
pub fn computing(trajectory: &Trajectory) -> f64 {
    let phases = trajectory.wall_time().iter().filter(|(phase, _)| *phase != "preparation");
    phases.map(|(_, seconds)| seconds).sum()
}

/// The same with the preparation: of a rollout that simulates the frames it starts from.
pub fn with_preparation(trajectory: &Trajectory) -> f64 {
    trajectory.wall_time().values().sum()
}
