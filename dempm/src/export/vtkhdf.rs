//! Grains for ParaView and VTK: a VTKHDF file of one point a grain over time.

use std::path::Path;

use files::{refuse_input, write_atomically};
use hdf5::{Dataset, Group, H5Type};
use ndarray::{Array1, ArrayView, s};

use super::error::ExportError;
use crate::trajectory::vtk_layout::{create_root, new_group, store, write_cells, write_steps};
use crate::trajectory::{GrainFrame, StaticGrains, Trajectory, WriteThrough};

/// Most rows of a chunk.
const CHUNK: usize = 65_536;

/// Writes the frames with grains of a trajectory: positions, radius, velocity, pressure, column and id.
///
/// # Errors
/// If the trajectory has no grains, cannot be read or is itself `output`, a position or velocity is no
/// number, or the file cannot be written.
pub fn write(trajectory: &Trajectory, output: &Path) -> Result<(), ExportError> {
    refuse_input(output, [trajectory.path()])?;
    let none = || ExportError::NoGrains { path: trajectory.path().to_owned() };
    let grains =
        trajectory.grains()?.filter(|grains| !grains.radius.is_empty()).ok_or_else(none)?;
    let frames: Vec<usize> = (0..trajectory.frames()).step_by(grains.every).collect();
    let failed = ExportError::hdf5(output);
    write_atomically(output, |temporary| {
        let file = WriteThrough::create(temporary, |access| access).map_err(&failed)?;
        let root = create_root(&file).map_err(&failed)?;
        let time = frames.iter().map(|&frame| trajectory.time()[frame]);
        let series = Series::create(&root, &grains, time.collect()).map_err(&failed)?;
        for (index, &frame) in frames.iter().enumerate() {
            let Some(now) = trajectory.grain_frame(frame)? else { continue };
            check_finite(trajectory, frame, &now)?;
            series.write(index, &now).map_err(&failed)?;
        }
        file.close().map_err(&failed)
    })
}

/// Refuses positions and velocities that are no numbers.
fn check_finite(
    trajectory: &Trajectory,
    frame: usize,
    grains: &GrainFrame,
) -> Result<(), ExportError> {
    for (field, vectors) in [("position", &grains.position), ("velocity", &grains.velocity)] {
        if let Some(grain) = vectors.iter().position(|v| v.iter().any(|x| !x.is_finite())) {
            let path = trajectory.path().to_owned();
            return Err(ExportError::GrainNotFinite { path, field, frame, grain });
        }
    }
    Ok(())
}

/// The arrays over all frames, one after the other.
struct Series {
    grains: usize,
    points: Dataset,
    velocity: Dataset,
    pressure: Dataset,
}

impl Series {
    fn create(root: &Group, grains: &StaticGrains, time: Vec<f64>) -> hdf5::Result<Self> {
        let (count, frames) = (grains.radius.len(), time.len());
        write_cells(root, count)?;
        write_steps(root, frames, count, &["velocity", "pressure"], &["radius", "column", "id"])?;
        store(&root.group("Steps")?, "Values", &Array1::from(time))?;
        let data = new_group(root, "PointData")?;
        store(&data, "radius", &Array1::from(grains.radius.clone()))?;
        store(&data, "column", &Array1::from(grains.column.clone()))?;
        store(&data, "id", &Array1::from_iter(0..count as u32))?;
        let rows = count * frames;
        Ok(Self {
            grains: count,
            points: array::<f32>(root, "Points", &[rows, 3])?,
            velocity: array::<f32>(&data, "velocity", &[rows, 3])?,
            pressure: array::<f32>(&data, "pressure", &[rows])?,
        })
    }

    /// Writes frame number `index`.
    fn write(&self, index: usize, frame: &GrainFrame) -> hdf5::Result<()> {
        let rows = index * self.grains..(index + 1) * self.grains;
        for (dataset, vectors) in
            [(&self.points, &frame.position), (&self.velocity, &frame.velocity)]
        {
            let in_space: Vec<[f32; 3]> = vectors.iter().map(|&[x, y]| [x, y, 0.0]).collect();
            let view = ArrayView::from_shape((self.grains, 3), in_space.as_flattened())
                .map_err(|error| hdf5::Error::from(error.to_string()))?;
            dataset.write_slice(view, s![rows.clone(), ..])?;
        }
        self.pressure.write_slice(&frame.pressure, s![rows])
    }
}

/// An empty compressed array.
fn array<T: H5Type>(group: &Group, name: &str, shape: &[usize]) -> hdf5::Result<Dataset> {
    let mut chunk = shape.to_vec();
    chunk[0] = chunk[0].min(CHUNK);
    group
        .new_dataset::<T>()
        .shape(shape.to_vec())
        .chunk(chunk)
        .shuffle()
        .deflate(4)
        .obj_track_times(false)
        .create(name)
}
