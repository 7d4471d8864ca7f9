//! HDF5 files for LagrangeBench: a group `00000`, `00001`, ... a trajectory with `position`
//! (frames, particles, 2) and `particle_type` (particles), as `lagrangebench/data/data.py` reads them.

use std::path::Path;

use files::write_atomically;
use ndarray::{Array1, s};

use super::error::ExportError;
use super::particles::{Kind, Particles};
use crate::trajectory::WriteThrough;

/// `NodeType` of `lagrangebench/utils.py`.
const FLUID: i64 = 0;
const SOLID_WALL: i64 = 1;
const MOVING_WALL: i64 = 2;

/// Writes the trajectories of a split to `path` with the suffix `.h5`.
pub(super) fn write(trajectories: &[Particles], path: &Path) -> Result<(), ExportError> {
    let path = path.with_extension("h5");
    let failed = ExportError::hdf5(&path);
    write_atomically(&path, |temporary| {
        let file = WriteThrough::create(temporary, |access| access).map_err(&failed)?;
        for (index, particles) in trajectories.iter().enumerate() {
            let (frames, count) = (particles.trajectory.frames(), particles.count());
            let group = file.create_group(&format!("{index:05}")).map_err(&failed)?;
            let position = group
                .new_dataset::<f32>()
                .shape([frames, count, 2])
                .chunk([1, count, 2])
                .shuffle()
                .deflate(4)
                .create("position")
                .map_err(&failed)?;
            for frame in 0..frames {
                let positions = particles.positions(frame)?;
                position.write_slice(&positions, s![frame, .., ..]).map_err(&failed)?;
            }
            let kind = |kind: &Kind| match kind {
                Kind::Material => FLUID,
                Kind::Fixed => SOLID_WALL,
                Kind::Moving => MOVING_WALL,
            };
            group
                .new_dataset_builder()
                .with_data(&Array1::from_iter(particles.kinds.iter().map(kind)))
                .create("particle_type")
                .map_err(&failed)?;
        }
        file.close().map_err(&failed)
    })
}
