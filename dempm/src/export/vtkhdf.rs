//! Grains for ParaView and VTK: a VTKHDF file of one point a grain over time, with walls and boxes.

use std::path::Path;

use files::{refuse_input, write_atomically};
use hdf5::{Dataset, Group, H5Type};
use ndarray::{Array1, Array2, ArrayView, s};

use super::error::ExportError;
use super::outlines::{box_corners, wall_ends};
use crate::trajectory::new_group;
use crate::trajectory::vtk_layout::{Cells, ROOT, create_block, create_root, store, write_steps};
use crate::trajectory::{GrainFrame, StaticGrains, Trajectory, WriteThrough};

/// Most rows of a chunk.
const CHUNK: usize = 65_536;

/// The block of grains.
const GRAINS: &str = "grains";

/// Writes the frames with grains of a trajectory: positions, radius, velocity, pressure, column and id,
/// and the walls and boxes.
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
        let walls = wall_ends(trajectory);
        let cells = Cells::Lines(walls.len() / 2);
        write_outlines(&root, "walls", cells, &walls, frames.len(), false).map_err(&failed)?;
        let mut corners = Vec::new();
        for &frame in &frames {
            corners.extend(box_corners(trajectory, frame)?);
        }
        let cells = Cells::Rectangles(corners.len() / (4 * frames.len()));
        write_outlines(&root, "boxes", cells, &corners, frames.len(), true).map_err(&failed)?;
        file.close().map_err(&failed)
    })
}

/// Writes a block of walls or boxes, if there are any: their points in all frames, or one set for all.
fn write_outlines(
    root: &Group,
    name: &str,
    cells: Cells,
    points: &[[f64; 3]],
    frames: usize,
    moving: bool,
) -> hdf5::Result<()> {
    if points.is_empty() {
        return Ok(());
    }
    let block = create_block(root, name, cells)?;
    let coordinates = Array2::from_shape_fn((points.len(), 3), |(point, axis)| points[point][axis]);
    store(&block, "Points", &coordinates)?;
    write_steps(&block, frames, moving.then_some(cells.points()), &[], &[])?;
    block.group("Steps")?.link_soft(&format!("/{ROOT}/{GRAINS}/Steps/Values"), "Values")
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
        let block = create_block(root, GRAINS, Cells::Vertices(count))?;
        let (series, fixed) = (["velocity", "pressure"], ["radius", "column", "id"]);
        write_steps(&block, frames, Some(count), &series, &fixed)?;
        store(&block.group("Steps")?, "Values", &Array1::from(time))?;
        let data = new_group(&block, "PointData")?;
        store(&data, "radius", &Array1::from(grains.radius.clone()))?;
        store(&data, "column", &Array1::from(grains.column.clone()))?;
        store(&data, "id", &Array1::from_iter(0..count as u32))?;
        let rows = count * frames;
        Ok(Self {
            grains: count,
            points: array::<f32>(&block, "Points", &[rows, 3])?,
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
