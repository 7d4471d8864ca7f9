//! The wall time by which methods are compared.

use dempm::trajectory::Trajectory;

/// Phases that make what later runs reuse, packings and kernels (`upload` compiles missing ones), and
/// copy it to the device.
const PREPARING: [&str; 2] = ["preparation", "upload"];

/// Wall time of the computation, s: all phases but the preparation. It includes the first frames of a
/// rollout if they were simulated.
pub fn computing(trajectory: &Trajectory) -> f64 {
    let phases = trajectory.wall_time().iter();
    let computing = phases.filter(|(phase, _)| !PREPARING.contains(&phase.as_str()));
    computing.map(|(_, seconds)| seconds).sum()
}
