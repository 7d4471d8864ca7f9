//! The wall time that a method is judged by.

use dempm::trajectory::Trajectory;

/// Wall time of the computation, s: all phases but the preparation of packings and kernels, which is
/// done once and kept. The frames that a rollout starts from count where it simulates them.
pub fn computing(trajectory: &Trajectory) -> f64 {
    let phases = trajectory.wall_time().iter().filter(|(phase, _)| *phase != "preparation");
    phases.map(|(_, seconds)| seconds).sum()
}
