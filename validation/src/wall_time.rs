//! The wall time that a method is judged by.

use dempm::trajectory::Trajectory;

/// Phases that make what is kept for the next run, packings and kernels (`upload` compiles those that
/// are not there), and carry it to the device.
const PREPARING: [&str; 2] = ["preparation", "upload"];

/// Wall time of the computation, s: all phases but those that prepare it. The frames that a rollout
/// starts from count where it simulates them.
pub fn computing(trajectory: &Trajectory) -> f64 {
    let phases = trajectory.wall_time().iter();
    let computing = phases.filter(|(phase, _)| !PREPARING.contains(&phase.as_str()));
    computing.map(|(_, seconds)| seconds).sum()
}
