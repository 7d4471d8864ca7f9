//! HDF5 files for LagrangeBench: a group `00000`, `00001`, ... a trajectory with `position`
//! (frames, points, 2) and `particle_type` (points), as `lagrangebench/data/data.py` reads them.

use std::path::Path;

use files::write_atomically;
use ndarray::{Array1, s};

use super::error::ExportError;
use super::positions::frames_f32;
use crate::trajectory::{Trajectory, WriteThrough};

/// `NodeType.FLUID` of LagrangeBench: free particles.
const FLUID: i64 = 0;

/// Writes the trajectories of a split to `path` with the suffix `.h5`.
pub(super) fn write(trajectories: &[Trajectory], path: &Path) -> Result<(), ExportError> {
    let path = path.with_extension("h5");
    let failed = ExportError::hdf5(&path);
    write_atomically(&path, |temporary| {
        let file = WriteThrough::create(temporary, |access| access).map_err(&failed)?;
        for (index, trajectory) in trajectories.iter().enumerate() {
            let points = trajectory.points().mass.len();
            let group = file.create_group(&format!("{index:05}")).map_err(&failed)?;
            let position = group
                .new_dataset::<f32>()
                .shape([trajectory.frames(), points, 2])
                .chunk([1, points, 2])
                .shuffle()
                .deflate(4)
                .create("position")
                .map_err(&failed)?;
            for (frame, positions) in frames_f32(trajectory).enumerate() {
                position.write_slice(&positions?, s![frame, .., ..]).map_err(&failed)?;
            }
            group
                .new_dataset_builder()
                .with_data(&Array1::from_elem(points, FLUID))
                .create("particle_type")
                .map_err(&failed)?;
        }
        file.close().map_err(&failed)
    })
}
