//! The group `grains`: the grains of every `every`-th frame.

use hdf5::{Dataset, File};

use super::attributes::{read_scalar, write_scalar};
use super::checked_file::{CheckedFile, to_rows};
use super::chunk::Values;
use super::error::{Result, TrajectoryError};
use super::grains::{GrainFrame, StaticGrains};
use super::links::{self, new_group};
use super::meaning;
use super::storage::{create_growing, read_frame, set_frames, write_whole};

pub(super) const GROUP: &str = "grains";
const EVERY: &str = "every";
const RADIUS: &str = "grains/radius";
const COLUMN: &str = "grains/column";
const POINT: &str = "grains/point";
const POSITION: &str = "grains/position";
const VELOCITY: &str = "grains/velocity";
const PRESSURE: &str = "grains/pressure";

/// Creates the group in a new file.
pub(super) fn create(file: &File, grains: &StaticGrains) -> hdf5::Result<()> {
    let group = new_group(file, GROUP)?;
    write_scalar(&group, EVERY, &(grains.every as u64))?;
    let count = grains.radius.len();
    write_whole(file, RADIUS, &[count], &grains.radius, meaning::GRAIN_RADIUS)?;
    write_whole(file, COLUMN, &[count], &grains.column, meaning::GRAIN_COLUMN)?;
    write_whole(file, POINT, &[count], &grains.point, meaning::GRAIN_POINT)?;
    create_growing::<f32>(file, POSITION, &[count, 2], meaning::GRAIN_POSITION)?;
    create_growing::<f32>(file, VELOCITY, &[count, 2], meaning::GRAIN_VELOCITY)?;
    create_growing::<f32>(file, PRESSURE, &[count], meaning::GRAIN_PRESSURE)?;
    Ok(())
}

/// Sets the length of the datasets for a number of frames of the trajectory.
pub(super) fn set_length(file: &File, frames: usize) -> hdf5::Result<()> {
    if !links::exists(file, GROUP)? {
        return Ok(());
    }
    let group = file.group(GROUP)?;
    let every = read_scalar::<u64>(&group, EVERY)?.max(1) as usize;
    for name in [POSITION, VELOCITY, PRESSURE] {
        set_frames(&file.dataset(name)?, frames.div_ceil(every))?;
    }
    Ok(())
}

/// The grains of the frame that is number `index` among those with grains.
pub(super) fn values(index: usize, frame: &GrainFrame) -> [Values<'_>; 3] {
    [
        Values::new(POSITION, index, frame.position.as_flattened()),
        Values::new(VELOCITY, index, frame.velocity.as_flattened()),
        Values::new(PRESSURE, index, &frame.pressure),
    ]
}

/// Why a frame cannot be written; `index` is its number in the trajectory.
pub(super) fn mismatch(
    grains: Option<(usize, usize)>,
    index: usize,
    frame: Option<&GrainFrame>,
) -> Option<String> {
    let expected = grains.filter(|(every, _)| index.is_multiple_of(*every)).map(|(_, count)| count);
    let Some(count) = expected else {
        return frame.map(|_| "it has grains, but none are expected".to_owned());
    };
    let Some(frame) = frame else { return Some("it has no grains".to_owned()) };
    let lengths = [frame.position.len(), frame.velocity.len(), frame.pressure.len()];
    (lengths != [count; 3]).then(|| {
        format!("positions, velocities and pressures of {lengths:?} grains, but there are {count}")
    })
}

/// The group of an open file.
#[derive(Debug)]
pub(super) struct GrainDatasets {
    /// Frames from one with grains to the next.
    pub every: usize,
    /// Number of grains.
    pub count: usize,
    radius: Dataset,
    column: Dataset,
    point: Dataset,
    position: Dataset,
    velocity: Dataset,
    pressure: Dataset,
}

impl GrainDatasets {
    /// Opens the group of a trajectory of `frames` frames, and checks its shapes; `None` if there is none.
    pub fn open(source: &CheckedFile<'_>, frames: usize) -> Result<Option<Self>> {
        let at = |item| TrajectoryError::at(source.path, item);
        if !links::exists(source.file, GROUP).map_err(at(GROUP))? {
            return Ok(None);
        }
        let group = links::group(source.file, GROUP).map_err(at(GROUP))?;
        let every: u64 = read_scalar(&group, EVERY).map_err(at(GROUP))?;
        if every == 0 {
            return Err(source.value_error("grains.every", "is 0, it must be 1 or more".to_owned()));
        }
        let every = usize::try_from(every).unwrap_or(usize::MAX);
        let radius = source.open(RADIUS)?;
        let count = radius.shape().first().copied().unwrap_or(0);
        let recorded = frames.div_ceil(every);
        let shaped = |name: &str, shape: &[usize]| {
            let dataset = source.open(name)?;
            source.expect_shape(name, &dataset, shape)?;
            Ok::<_, TrajectoryError>(dataset)
        };
        source.expect_shape(RADIUS, &radius, &[count])?;
        Ok(Some(Self {
            every,
            count,
            radius,
            column: shaped(COLUMN, &[count])?,
            point: shaped(POINT, &[count])?,
            position: shaped(POSITION, &[recorded, count, 2])?,
            velocity: shaped(VELOCITY, &[recorded, count, 2])?,
            pressure: shaped(PRESSURE, &[recorded, count])?,
        }))
    }

    /// Reads what never changes. Radii that are not positive are an error.
    pub fn fixed(&self, source: &CheckedFile<'_>) -> Result<StaticGrains> {
        let at = |item| TrajectoryError::at(source.path, item);
        let radius: Vec<f32> = self.radius.read_raw().map_err(at(RADIUS))?;
        if let Some(grain) = radius.iter().position(|r| !(*r > 0.0 && r.is_finite())) {
            let problem = format!("of grain {grain} is {} m, it must be above 0", radius[grain]);
            return Err(source.value_error(RADIUS, problem));
        }
        Ok(StaticGrains {
            every: self.every,
            radius,
            column: self.column.read_raw().map_err(at(COLUMN))?,
            point: self.point.read_raw().map_err(at(POINT))?,
        })
    }

    /// Reads number `index` of the frames with grains.
    pub fn frame(&self, source: &CheckedFile<'_>, index: usize) -> Result<GrainFrame> {
        let at = |item| TrajectoryError::at(source.path, item);
        Ok(GrainFrame {
            position: to_rows(read_frame(&self.position, index).map_err(at(POSITION))?),
            velocity: to_rows(read_frame(&self.velocity, index).map_err(at(VELOCITY))?),
            pressure: read_frame(&self.pressure, index).map_err(at(PRESSURE))?,
        })
    }

    /// Compressed size of all frames, bytes.
    pub fn stored_bytes(&self) -> u64 {
        [&self.position, &self.velocity, &self.pressure].map(|d| d.storage_size()).iter().sum()
    }
}
