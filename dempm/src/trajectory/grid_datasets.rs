//! The group `grid`: continuum fields of every frame.

use hdf5::{Dataset, File};

use super::attributes::{read_scalar, write_scalar};
use super::checked_file::{CheckedFile, to_rows};
use super::chunk::Values;
use super::error::{Result, TrajectoryError};
use super::grid::{GridFrame, StaticGrid};
use super::links::{self, new_group};
use super::meaning;
use super::storage::{create_growing, read_frame, set_frames, write_whole};

pub(super) const GROUP: &str = "grid";
const WIDTH: &str = "width";
const X: &str = "grid/x";
const Y: &str = "grid/y";
const DENSITY: &str = "grid/density";
const VELOCITY: &str = "grid/velocity";
const STRESS: &str = "grid/stress";

/// Creates the group in a new file.
pub(super) fn create(file: &File, grid: &StaticGrid) -> hdf5::Result<()> {
    let group = new_group(file, GROUP)?;
    write_scalar(&group, WIDTH, &grid.width)?;
    let [rows, columns] = [grid.y.len(), grid.x.len()];
    write_whole(file, X, &[columns], &grid.x, meaning::GRID_X)?;
    write_whole(file, Y, &[rows], &grid.y, meaning::GRID_Y)?;
    create_growing::<f32>(file, DENSITY, &[rows, columns], meaning::GRID_DENSITY)?;
    create_growing::<f32>(file, VELOCITY, &[rows, columns, 2], meaning::GRID_VELOCITY)?;
    create_growing::<f32>(file, STRESS, &[rows, columns, 4], meaning::GRID_STRESS)?;
    Ok(())
}

/// Sets the length of the datasets.
pub(super) fn set_length(file: &File, frames: usize) -> hdf5::Result<()> {
    if links::exists(file, GROUP)? {
        for name in [DENSITY, VELOCITY, STRESS] {
            set_frames(&file.dataset(name)?, frames)?;
        }
    }
    Ok(())
}

/// The fields of frame number `index`.
pub(super) fn values(index: usize, frame: &GridFrame) -> [Values<'_>; 3] {
    [
        Values::new(DENSITY, index, &frame.density),
        Values::new(VELOCITY, index, frame.velocity.as_flattened()),
        Values::new(STRESS, index, frame.stress.as_flattened()),
    ]
}

/// Why a frame cannot be written to a file with a grid of so many nodes, or without one.
pub(super) fn mismatch(nodes: Option<usize>, frame: Option<&GridFrame>) -> Option<String> {
    let found = frame.map(|f| [f.density.len(), f.velocity.len(), f.stress.len()]);
    let expected = nodes.map(|nodes| [nodes; 3]);
    (found != expected).then(|| format!("fields on {found:?} nodes, expected {expected:?}"))
}

/// The nodes along an axis. Nodes that do not increase are an error.
fn nodes(source: &CheckedFile<'_>, name: &str) -> Result<Vec<f64>> {
    let nodes: Vec<f64> = source.whole(name, None)?;
    let increases = |pair: &[f64]| pair[0] < pair[1] && pair[1].is_finite();
    match nodes.windows(2).position(|pair| !increases(pair)) {
        Some(k) => {
            let [before, node] = [nodes[k], nodes[k + 1]];
            let problem = format!("of node {} is {node} m, after {before} m", k + 1);
            Err(source.value_error(name, problem))
        }
        None => Ok(nodes),
    }
}

/// The group of an open file.
#[derive(Debug)]
pub(super) struct GridDatasets {
    /// The grid.
    pub grid: StaticGrid,
    density: Dataset,
    velocity: Dataset,
    stress: Dataset,
}

impl GridDatasets {
    /// Opens the group of a trajectory of `frames` frames, and checks its shapes; `None` if there is none.
    pub fn open(source: &CheckedFile<'_>, frames: usize) -> Result<Option<Self>> {
        let at = |item| TrajectoryError::at(source.path, item);
        if !links::exists(source.file, GROUP).map_err(at(GROUP))? {
            return Ok(None);
        }
        let group = links::group(source.file, GROUP).map_err(at(GROUP))?;
        let width: f64 = read_scalar(&group, WIDTH).map_err(at(GROUP))?;
        if !(width > 0.0 && width.is_finite()) {
            let problem = format!("is {width} m, it must be above 0");
            return Err(source.value_error("grid.width", problem));
        }
        let grid = StaticGrid { width, x: nodes(source, X)?, y: nodes(source, Y)? };
        let shaped = |name: &str, components: &[usize]| {
            let dataset = source.open(name)?;
            let shape = [&[frames, grid.y.len(), grid.x.len()], components].concat();
            source.expect_shape(name, &dataset, &shape)?;
            Ok::<_, TrajectoryError>(dataset)
        };
        let (density, velocity) = (shaped(DENSITY, &[])?, shaped(VELOCITY, &[2])?);
        let stress = shaped(STRESS, &[4])?;
        Ok(Some(Self { grid, density, velocity, stress }))
    }

    /// Reads frame number `index`.
    pub fn frame(&self, source: &CheckedFile<'_>, index: usize) -> Result<GridFrame> {
        let at = |item| TrajectoryError::at(source.path, item);
        Ok(GridFrame {
            density: read_frame(&self.density, index).map_err(at(DENSITY))?,
            velocity: to_rows(read_frame(&self.velocity, index).map_err(at(VELOCITY))?),
            stress: to_rows(read_frame(&self.stress, index).map_err(at(STRESS))?),
        })
    }
}
