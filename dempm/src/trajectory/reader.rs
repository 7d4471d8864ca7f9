//! Reading a trajectory, frame by frame or a window at a time.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use hdf5::{Dataset, File, H5Type};
use ndarray::{Array3, ArrayD};

use super::attributes::{has, read_all, read_scalar};
use super::checked_file::{CheckedFile, check_format, to_rows};
use super::error::{Result, TrajectoryError};
use super::frame::{Frame, Points};
use super::grain_datasets::GrainDatasets;
use super::grains::{GrainFrame, StaticGrains};
use super::grid::{GridFrame, StaticGrid};
use super::grid_datasets::GridDatasets;
use super::header::Header;
use super::header_limits::implausible;
use super::layout::{
    BOXES, BUDGET, COLUMN, Field, MASS, REST_TIME, TIME, WALL_TIME, WALLS, WARNINGS,
};
use super::links;
use super::opening::open_hdf5;
use super::storage::frame_selection;
use super::texts::read_text;

/// A trajectory file open for reading. Header, points and times are in memory; frames are read on
/// demand.
#[derive(Debug)]
pub struct Trajectory {
    path: PathBuf,
    file: File,
    header: Header,
    points: Points,
    time: Vec<f64>,
    status: String,
    warnings: Option<String>,
    rest_time: Option<f64>,
    wall_time: BTreeMap<String, f64>,
    fields: Vec<(Field, Dataset)>,
    boxes: Option<Dataset>,
    grains: Option<GrainDatasets>,
    grid: Option<GridDatasets>,
    budget: BTreeMap<String, Vec<f64>>,
}

impl Trajectory {
    /// Opens a trajectory and checks that its datasets fit together.
    ///
    /// # Errors
    /// If it is not a trajectory, comes from a later format, is damaged or inconsistent.
    pub fn open(path: &Path) -> Result<Self> {
        let (file, size) = open_hdf5(path)?;
        check_format(path, &file)?;
        let located =
            |(item, source)| TrajectoryError::Hdf5 { path: path.to_owned(), item, source };

        let source = CheckedFile { path, file: &file, size };
        let mut header = Header::read(&file).map_err(located)?;
        if let Some(dataset) = source.find(WALLS)? {
            header.walls = source.rows::<f64, 4>(&dataset, WALLS)?;
        }
        if let Some((item, problem)) = implausible(&header) {
            return Err(source.value_error(item, problem));
        }
        let points =
            Points { mass: source.whole(MASS, None)?, column: source.whole(COLUMN, None)? };
        source.expect_length(COLUMN, points.column.len(), points.mass.len())?;
        let time: Vec<f64> = source.whole(TIME, None)?;
        source.check_numbers(&points.mass, &time)?;

        let mut fields = Vec::new();
        for field in Field::ALL {
            let dataset = match source.find(field.name())? {
                Some(dataset) => dataset,
                None if Field::OPTIONAL.contains(&field) => continue,
                None => source.open(field.name())?,
            };
            let shape = field.shape(time.len(), points.mass.len());
            source.expect_shape(field.name(), &dataset, &shape)?;
            fields.push((field, dataset));
        }
        let boxes = source.find(BOXES)?;
        if let Some(dataset) = &boxes {
            let count = dataset.shape().get(1).copied().unwrap_or(0);
            source.expect_shape(BOXES, dataset, &[time.len(), count, 4])?;
        }
        let grains = GrainDatasets::open(&source, time.len())?;
        let grid = GridDatasets::open(&source, time.len())?;
        let mut budget = BTreeMap::new();
        let names = links::group(&file, BUDGET)
            .and_then(|group| group.member_names())
            .map_err(TrajectoryError::at(path, BUDGET))?;
        for name in names {
            let values = source.whole(&format!("{BUDGET}/{name}"), Some(time.len()))?;
            budget.insert(name, values);
        }
        let status = read_text(&file, "status").map_err(TrajectoryError::at(path, "status"))?;
        let warnings = has(&file, WARNINGS)
            .and_then(|has| has.then(|| read_text(&file, WARNINGS)).transpose())
            .map_err(TrajectoryError::at(path, WARNINGS))?;
        let rest_time = has(&file, REST_TIME)
            .and_then(|has| has.then(|| read_scalar(&file, REST_TIME)).transpose())
            .map_err(TrajectoryError::at(path, REST_TIME))?;
        let wall_time =
            links::group(&file, WALL_TIME).map_err(TrajectoryError::at(path, WALL_TIME))?;
        let wall_time =
            read_all(&wall_time, |group, name| read_scalar(group, name)).map_err(located)?;
        Ok(Self {
            path: path.to_owned(),
            header,
            points,
            time,
            status,
            warnings,
            rest_time,
            wall_time,
            fields,
            boxes,
            grains,
            grid,
            budget,
            file,
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The header.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The properties of the points that never change.
    pub fn points(&self) -> &Points {
        &self.points
    }

    /// The number of frames.
    pub fn frames(&self) -> usize {
        self.time.len()
    }

    /// The times of the frames, s.
    pub fn time(&self) -> &[f64] {
        &self.time
    }

    /// Status of the run: `running` (or killed), `finished`, or what stopped it.
    pub fn status(&self) -> &str {
        &self.status
    }

    /// Warnings that the run gave about itself; `None` if the program that made the file gives none.
    pub fn warnings(&self) -> Option<Vec<&str>> {
        Some(self.warnings.as_ref()?.lines().collect())
    }

    /// Time from which on frames repeat a state at rest, s; `None` if the run did not come to rest.
    pub fn rest_time(&self) -> Option<f64> {
        self.rest_time
    }

    /// Wall time of the run per phase, s.
    pub fn wall_time(&self) -> &BTreeMap<String, f64> {
        &self.wall_time
    }

    /// The scalars of the whole scene: one value per frame for each name.
    pub fn budget(&self) -> &BTreeMap<String, Vec<f64>> {
        &self.budget
    }

    /// The fields that the file has.
    pub fn fields(&self) -> impl Iterator<Item = Field> + '_ {
        self.fields.iter().map(|(field, _)| *field)
    }

    /// Compressed size of a field, bytes.
    pub fn stored_bytes(&self, field: Field) -> u64 {
        self.dataset(field).map_or(0, |dataset| dataset.storage_size())
    }

    /// Reads one frame.
    ///
    /// # Errors
    /// If there is no such frame or its data are damaged.
    pub fn frame(&self, index: usize) -> Result<Frame> {
        let one = index..index.saturating_add(1);
        self.check_range(&one)?;
        let mut frame = Frame {
            time: self.time[index],
            position: self.rows(Field::Position, one.clone())?.unwrap_or_default(),
            velocity: self.rows(Field::Velocity, one.clone())?.unwrap_or_default(),
            stress: self.rows(Field::Stress, one.clone())?,
            ..Frame::default()
        };
        for field in Field::OPTIONAL {
            if let (Some(dataset), Some(place)) = (self.dataset(field), frame.scalar_mut(field)) {
                *place = Some(self.read(dataset, field.name(), one.clone())?.0);
            }
        }
        if let Some(dataset) = &self.boxes {
            frame.boxes = to_rows(self.read(dataset, BOXES, one)?.0);
        }
        frame.budget =
            self.budget.iter().map(|(name, values)| (name.clone(), values[index])).collect();
        Ok(frame)
    }

    /// Frames from one with grains to the next; `None` without grains.
    pub fn grain_interval(&self) -> Option<usize> {
        self.grains.as_ref().map(|grains| grains.every)
    }

    /// The number of grains; `None` without grains.
    pub fn grain_count(&self) -> Option<usize> {
        self.grains.as_ref().map(|grains| grains.count)
    }

    /// Compressed size of the grains of all frames, bytes.
    pub fn stored_grain_bytes(&self) -> u64 {
        self.grains.as_ref().map_or(0, GrainDatasets::stored_bytes)
    }

    /// Reads the properties of the grains that never change; `None` without grains.
    ///
    /// # Errors
    /// If they are damaged.
    pub fn grains(&self) -> Result<Option<StaticGrains>> {
        self.grains.as_ref().map(|grains| grains.fixed(&self.checked())).transpose()
    }

    /// Reads the grains of a frame; `None` if it has none.
    ///
    /// # Errors
    /// As [`frame`](Self::frame).
    pub fn grain_frame(&self, index: usize) -> Result<Option<GrainFrame>> {
        self.check_range(&(index..index.saturating_add(1)))?;
        let grains = self.grains.as_ref().filter(|grains| index.is_multiple_of(grains.every));
        grains.map(|grains| grains.frame(&self.checked(), index / grains.every)).transpose()
    }

    /// The grid of continuum fields, if the file has them.
    pub fn grid(&self) -> Option<&StaticGrid> {
        self.grid.as_ref().map(|datasets| &datasets.grid)
    }

    /// Reads the fields on the grid at a frame; `None` if the file has none.
    ///
    /// # Errors
    /// As [`frame`](Self::frame).
    pub fn grid_frame(&self, index: usize) -> Result<Option<GridFrame>> {
        self.check_range(&(index..index.saturating_add(1)))?;
        self.grid.as_ref().map(|grid| grid.frame(&self.checked(), index)).transpose()
    }

    /// Reads the positions of a window of frames, m: shape (frames, points, 2).
    ///
    /// # Errors
    /// As [`frame`](Self::frame).
    pub fn positions(&self, frames: Range<usize>) -> Result<Array3<f64>> {
        self.window(Field::Position, frames)
    }

    /// Reads the velocities of a window of frames, m/s: shape (frames, points, 2).
    ///
    /// # Errors
    /// As [`frame`](Self::frame).
    pub fn velocities(&self, frames: Range<usize>) -> Result<Array3<f64>> {
        self.window(Field::Velocity, frames)
    }

    /// Reads the boxes of a window of frames, m: shape (frames, boxes, 4).
    ///
    /// # Errors
    /// As [`frame`](Self::frame).
    pub fn boxes(&self, frames: Range<usize>) -> Result<Array3<f64>> {
        self.check_range(&frames)?;
        match &self.boxes {
            Some(dataset) => {
                let (values, shape) = self.read(dataset, BOXES, frames)?;
                self.array3(values, &shape, BOXES)
            }
            None => Ok(Array3::zeros((frames.len(), 0, 4))),
        }
    }

    /// Reads a window of frames of any field: the values in C order and their shape, (frames,
    /// points) or (frames, points, components). `None` if the file lacks the field.
    ///
    /// # Errors
    /// As [`frame`](Self::frame).
    pub fn field<T: H5Type>(
        &self,
        field: Field,
        frames: Range<usize>,
    ) -> Result<Option<ArrayD<T>>> {
        self.check_range(&frames)?;
        let Some(dataset) = self.dataset(field) else { return Ok(None) };
        let (values, shape) = self.read(dataset, field.name(), frames)?;
        ArrayD::from_shape_vec(shape, values)
            .map(Some)
            .map_err(|error| TrajectoryError::at(&self.path, field.name())(error.into()))
    }

    fn window(&self, field: Field, frames: Range<usize>) -> Result<Array3<f64>> {
        self.check_range(&frames)?;
        match self.dataset(field) {
            Some(dataset) => {
                let (values, shape) = self.read(dataset, field.name(), frames)?;
                self.array3(values, &shape, field.name())
            }
            None => Ok(Array3::zeros((0, 0, 2))),
        }
    }

    fn array3(&self, values: Vec<f64>, shape: &[usize], name: &str) -> Result<Array3<f64>> {
        let &[frames, rows, columns] = shape else {
            return Err(TrajectoryError::Shape {
                path: self.path.clone(),
                item: name.to_owned(),
                found: shape.to_vec(),
                expected: "three dimensions".to_owned(),
            });
        };
        Array3::from_shape_vec((frames, rows, columns), values)
            .map_err(|error| TrajectoryError::at(&self.path, name)(error.into()))
    }

    fn rows<T: H5Type + Copy, const N: usize>(
        &self,
        field: Field,
        frames: Range<usize>,
    ) -> Result<Option<Vec<[T; N]>>> {
        self.dataset(field)
            .map(|dataset| Ok(to_rows(self.read(dataset, field.name(), frames)?.0)))
            .transpose()
    }

    /// Reads frames of a dataset whose shape was checked: the values and their shape.
    fn read<T: H5Type>(
        &self,
        dataset: &Dataset,
        name: &str,
        frames: Range<usize>,
    ) -> Result<(Vec<T>, Vec<usize>)> {
        let mut shape = dataset.shape();
        shape[0] = frames.len();
        let array: ArrayD<T> = dataset
            .read_slice(frame_selection(frames, shape.len()))
            .map_err(TrajectoryError::at(&self.path, name))?;
        Ok((array.into_raw_vec_and_offset().0, shape))
    }

    fn checked(&self) -> CheckedFile<'_> {
        CheckedFile { path: &self.path, file: &self.file, size: self.file.size() }
    }

    fn dataset(&self, field: Field) -> Option<&Dataset> {
        self.fields.iter().find(|(other, _)| *other == field).map(|(_, dataset)| dataset)
    }

    fn check_range(&self, frames: &Range<usize>) -> Result<()> {
        let last = frames.end.saturating_sub(1).max(frames.start);
        if frames.start > frames.end || last >= self.frames() && !frames.is_empty() {
            return Err(TrajectoryError::NoSuchFrame {
                path: self.path.clone(),
                frame: last,
                frames: self.frames(),
            });
        }
        Ok(())
    }

    /// Size of the file, bytes.
    pub fn file_size(&self) -> u64 {
        self.file.size()
    }
}
