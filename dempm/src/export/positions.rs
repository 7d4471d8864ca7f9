//! Positions in the form that GNS and LagrangeBench keep them.

use ndarray::{Array2, Axis};

use crate::trajectory::{Trajectory, TrajectoryError};

/// Positions of all frames in single precision, m: shape (points, 2) each.
pub(super) fn frames_f32(
    trajectory: &Trajectory,
) -> impl Iterator<Item = Result<Array2<f32>, TrajectoryError>> {
    (0..trajectory.frames()).map(|index| {
        let frame = trajectory.positions(index..index + 1)?;
        Ok(frame.index_axis(Axis(0), 0).mapv(|x| x as f32))
    })
}
